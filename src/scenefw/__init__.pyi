from scenefw.api.load import load as load
