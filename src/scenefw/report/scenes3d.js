// Shows the scenes of a page: turn with the mouse, choose what is drawn. Needs THREE (r140 or newer).
(() => {
  "use strict";

  async function unpacked(text) {
    const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }

  function made(kind, parent, values = {}) {
    const element = Object.assign(document.createElement(kind), values);
    parent.append(element);
    return element;
  }

  function summed(differences, step) {
    const sums = new Int32Array(differences.length);
    for (let i = 0; i < sums.length; i++) sums[i] = differences[i] + (i < step ? 0 : sums[i - step]);
    return sums;
  }

  function surface(solid, data, unit, looks = {}) {
    const geometry = new THREE.BufferGeometry();
    const vertices = summed(new Int16Array(data, ...solid.vertices), 3);
    const faces = summed(new Int32Array(data, ...solid.faces), 1);
    // Differences of 16 bits wrap around
    const metres = Float32Array.from(vertices, (value) => ((value << 16) >> 16) * unit);
    geometry.setAttribute("position", new THREE.BufferAttribute(metres, 3));
    geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(faces), 1));
    geometry.computeVertexNormals();
    geometry.computeBoundingBox();
    const colour = new THREE.Color(...solid.colour).convertSRGBToLinear();
    const material = new THREE.MeshStandardMaterial({ color: colour, roughness: 0.75, ...looks });
    return new THREE.Mesh(geometry, material);
  }

  function cloud(points, data, unit) {
    const geometry = new THREE.BufferGeometry();
    const metres = Float32Array.from(new Int16Array(data, ...points.positions), (v) => v * unit);
    const colours = Float32Array.from(new Uint8Array(data, ...points.colours), (v) => (v / 255) ** 2.2);
    geometry.setAttribute("position", new THREE.BufferAttribute(metres, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    return new THREE.Points(geometry, new THREE.PointsMaterial({ size: 0.006, vertexColors: true }));
  }

  // Rods from each object down to what it stands on; 0 is the floor.
  function links(supports, solids) {
    const places = new Map(solids.map((solid) => [Number(solid.name.split(":")[0]), solid.middle]));
    const material = new THREE.MeshBasicMaterial({ color: 0x1c2126, depthTest: false });
    return supports.objects.flatMap(({ id, stands_on }) => stands_on.map((below) => {
      const place = places.get(id);
      const path = new THREE.LineCurve3(place, below === 0 ? place.clone().setZ(0) : places.get(below));
      const rod = new THREE.Mesh(new THREE.TubeGeometry(path, 1, 0.002, 6), material);
      rod.renderOrder = 1;
      return rod;
    }));
  }

  // What carries an object and what falls with it, in words.
  function carried({ stands_on, falls }) {
    const below = stands_on.map((id) => (id === 0 ? "the floor" : id)).join(", ");
    const place = below ? `on ${below}` : "touches nothing below it";
    return falls.length ? `${place}; ${falls.join(", ")} would fall with it` : place;
  }

  // Turns, moves and zooms a camera around a target; z stays up.
  class Turntable {
    constructor(camera, canvas, changed) {
      Object.assign(this, { camera, changed, target: new THREE.Vector3(), yaw: 0, pitch: 0.6, range: 1 });
      const held = new Map();
      let gap = 0;
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        held.set(event.pointerId, event);
        gap = 0;
      });
      for (const end of ["pointerup", "pointercancel"])
        canvas.addEventListener(end, (event) => held.delete(event.pointerId));
      canvas.addEventListener("pointermove", (event) => {
        const before = held.get(event.pointerId);
        if (!before) return;
        const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
        held.set(event.pointerId, event);
        if (held.size === 2) {
          const [a, b] = held.values();
          const now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
          if (gap) this.range *= gap / now;
          gap = now;
          this.move(x / 2, y / 2, canvas.clientHeight);
        } else if (before.buttons & 2 || event.shiftKey) {
          this.move(x, y, canvas.clientHeight);
        } else {
          this.yaw -= x * 0.008;
          this.pitch += y * 0.008;
        }
        this.place();
      });
      canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        this.range *= Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 100) * 0.0012);
        this.place();
      }, { passive: false });
    }

    move(x, y, height) {
      const step = (2 * this.range * Math.tan((this.camera.fov * Math.PI) / 360)) / height;
      const [right, up] = [new THREE.Vector3(), new THREE.Vector3()];
      this.camera.matrixWorld.extractBasis(right, up, new THREE.Vector3());
      this.target.addScaledVector(right, -x * step).addScaledVector(up, y * step);
    }

    place() {
      this.pitch = Math.min(1.55, Math.max(-0.2, this.pitch));
      this.range = Math.min(8, Math.max(0.1, this.range));
      const flat = Math.cos(this.pitch) * this.range;
      this.camera.position.set(
        Math.cos(this.yaw) * flat, Math.sin(this.yaw) * flat, Math.sin(this.pitch) * this.range,
      ).add(this.target);
      this.camera.lookAt(this.target);
      this.changed();
    }
  }

  // One block of scenes.
  async function show(stage) {
    const header = JSON.parse(stage.querySelector(".header").textContent);
    const data = await unpacked(stage.querySelector(".data").textContent);
    const renderer = new THREE.WebGLRenderer({ antialias: window.devicePixelRatio < 2, alpha: true });
    renderer.outputEncoding = THREE.sRGBEncoding;
    renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    const canvas = renderer.domElement;
    stage.append(canvas);
    const world = new THREE.Scene();
    const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 30);
    camera.up.set(0, 0, 1);
    const sky = new THREE.HemisphereLight(0xffffff, 0x8a8f94, 0.75);
    sky.position.set(0, 0, 1);
    const lamp = new THREE.DirectionalLight(0xffffff, 0.55);
    world.add(sky, lamp);
    const state = {
      scene: 0, layer: 0, points: true, floor: true, names: true, obstacles: true, links: false, hidden: new Set(),
    };
    // A link to page.html#scene=1&layer=2 opens that one
    for (const [name, value] of new URLSearchParams(location.hash.slice(1)))
      if (name === "scene" || name === "layer") state[name] = Math.max(0, Number.parseInt(value) || 0);
    let waiting = false;
    let drawn = { solids: [], tags: [] };
    const turntable = new Turntable(camera, canvas, () => later());
    const isNarrow = () => stage.clientWidth <= 700;
    const isTouched = window.matchMedia("(pointer: coarse)").matches;
    const panel = made("details", stage, { className: "panel", open: !isNarrow() });
    const hint = isTouched ? "one finger: turn · two: move and zoom" : "drag: turn · shift or right: move · wheel: zoom";
    made("div", stage, { className: "hint", textContent: hint });

    function later() {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; draw(); });
    }

    function draw() {
      const [width, height] = [stage.clientWidth, stage.clientHeight];
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      // The panel hides the left edge, or the lower one: the scene goes to the middle of the rest
      camera.setViewOffset(width, height, isNarrow() ? 0 : -120, isNarrow() && panel.open ? panel.offsetHeight / 2 : 0, width, height);
      camera.updateProjectionMatrix();
      lamp.position.copy(camera.position).add(new THREE.Vector3(0, 0, 0.6));
      renderer.render(world, camera);
      drawn.solids.forEach((solid, number) => {
        const tag = drawn.tags[number];
        const place = solid.top.clone().project(camera);
        tag.hidden = !(state.names && solid.mesh.visible && place.z < 1);
        const [x, y] = [(place.x + 1) * width / 2, (1 - place.y) * height / 2];
        tag.style.transform = `translate(${x}px, ${y}px) translate(-50%, -120%)`;
      });
      stage.dataset.triangles = renderer.info.render.triangles;
      stage.dataset.points = renderer.info.render.points;
      stage.dataset.layer = header.scenes[state.scene].layers[state.layer].name;
    }

    function build(newScene) {
      for (const old of [...world.children]) {
        if (old.isLight) continue;
        world.remove(old);
        old.geometry.dispose();
        old.material.dispose();
      }
      drawn.tags.forEach((tag) => tag.remove());
      state.scene = Math.min(state.scene, header.scenes.length - 1);
      const scene = header.scenes[state.scene];
      state.layer = Math.min(state.layer, scene.layers.length - 1);
      const box = new THREE.Box3();
      drawn = { solids: [], tags: [] };
      for (const solid of scene.layers[state.layer].solids) {
        const mesh = surface(solid, data, header.unit);
        const limits = mesh.geometry.boundingBox;
        box.union(limits);
        const middle = limits.getCenter(new THREE.Vector3());
        drawn.solids.push({ mesh, name: solid.name, middle: middle.clone(), top: middle.setZ(limits.max.z) });
        drawn.tags.push(made("div", stage, { className: "tag", textContent: solid.name.split(":")[0] }));
        mesh.visible = !state.hidden.has(solid.name.split(":")[0]);
        world.add(mesh);
      }
      const { supports } = scene.layers[state.layer];
      if (state.links && supports) world.add(...links(supports, drawn.solids));
      if (state.obstacles)
        for (const obstacle of scene.obstacles)
          world.add(surface(obstacle, data, header.unit, { side: THREE.DoubleSide, transparent: true, opacity: 0.7 }));
      if (state.points) world.add(cloud(scene.points, data, header.unit));
      if (box.isEmpty()) box.set(new THREE.Vector3(-0.3, -0.3, 0), new THREE.Vector3(0.3, 0.3, 0.3));
      const middle = box.getCenter(new THREE.Vector3());
      if (state.floor) {
        const grid = new THREE.GridHelper(2, 20, 0x98a2ac, 0xc4cbd1);
        grid.rotation.x = Math.PI / 2;
        grid.position.set(Math.round(middle.x * 10) / 10, Math.round(middle.y * 10) / 10, -0.001);
        world.add(grid);
      }
      if (newScene) {
        const eye = new THREE.Vector3(...scene.eye).sub(middle);
        turntable.target.copy(middle);
        turntable.yaw = Math.atan2(eye.y, eye.x) + 0.35;
        turntable.pitch = Math.max(0.4, Math.atan2(eye.z, Math.hypot(eye.x, eye.y)));
        const upright = Math.max(1, (0.8 * stage.clientHeight) / stage.clientWidth);  // of phones
        turntable.range = 1.4 * upright * box.getSize(new THREE.Vector3()).length();
      }
      if (newScene) frame(scene);
      controls(scene);
      turntable.place();
    }

    function toggle(parent, text, checked, changed, colour) {
      const label = made("label", parent);
      const input = made("input", label, { type: "checkbox", checked });
      if (colour) made("span", label, { className: "chip" }).style.background = colour;
      made("span", label, { textContent: text });
      input.addEventListener("change", () => changed(input.checked));
      return label;
    }

    // What stays while the slider moves, or it would be lost under the pointer.
    function frame(scene) {
      panel.replaceChildren();
      made("strong", made("summary", panel), { className: "shown" });
      if (header.scenes.length > 1) {
        const select = made("select", panel, { ariaLabel: "scene" });
        for (const one of header.scenes) made("option", select, { textContent: one.name });
        select.selectedIndex = state.scene;
        select.addEventListener("change", () => {
          Object.assign(state, { scene: select.selectedIndex, layer: 0 });
          state.hidden.clear();
          build(true);
        });
      }
      if (scene.layers.length > 1) {
        const slider = made("input", panel, {
          type: "range", min: 0, max: scene.layers.length - 1, ariaLabel: "hypothesis",
        });
        slider.value = state.layer;
        slider.addEventListener("input", () => { state.layer = Number(slider.value); build(false); });
      }
      made("div", panel, { className: "solids" });
      made("hr", panel);
      const shown = [["points", "measured points"], ["floor", "floor, squares of 10 cm"], ["names", "numbers"]];
      if (scene.layers.some((layer) => layer.supports)) shown.push(["links", "rods to what carries each"]);
      if (scene.obstacles.length) shown.push(["obstacles", `obstacles: ${[...new Set(scene.obstacles.map((o) => o.name))].join(", ")}`]);
      for (const [key, text] of shown)
        toggle(panel, text, state[key], (on) => { state[key] = on; build(false); });
    }

    function controls(scene) {
      const { name, solids, supports } = scene.layers[state.layer];
      const carriers = new Map((supports ? supports.objects : []).map((item) => [String(item.id), item]));
      const count = solids.length === 1 ? "1 object" : `${solids.length} objects`;
      panel.querySelector(".shown").textContent = `${name}: ${count}`;
      const list = panel.querySelector(".solids");
      list.replaceChildren();
      for (const solid of solids) {
        const [key] = solid.name.split(":");
        const colour = `rgb(${solid.colour.map((value) => Math.round(255 * value))})`;
        const row = toggle(list, solid.name, !state.hidden.has(key), (on) => {
          if (on) state.hidden.delete(key); else state.hidden.add(key);
          drawn.solids.forEach(({ mesh, name }) => { mesh.visible = !state.hidden.has(name.split(":")[0]); });
          later();
        }, colour);
        if (carriers.has(key)) made("small", row.lastChild, { textContent: carried(carriers.get(key)) });
      }
      if (supports && solids.length > 1)
        made("p", list, { className: "order", textContent: `take away in this order: ${supports.removal_order.join(" → ")}` });
    }

    panel.addEventListener("toggle", () => { if (isNarrow()) later(); });
    new ResizeObserver(() => {  // also called at the start
      const size = renderer.getSize(new THREE.Vector2());
      if (size.x !== stage.clientWidth || size.y !== stage.clientHeight) later();
    }).observe(stage);
    build(true);
  }

  for (const stage of document.querySelectorAll(".stage"))
    show(stage).catch((reason) => {
      console.error(reason);
      made("div", stage, { className: "sorry", textContent: "This browser can't draw the scene (WebGL): open the GLB instead." });
    });
})();
