from scenefw.evaluation.stacks.published import SUPERQUADRICS, YCB


def test_the_table_has_all_methods_of_both_data_sets():
    for table in (SUPERQUADRICS, YCB):
        assert list(table) == ["SIMstack", "FC", "SSCNet**"]
        for name in ("chamfer_visible", "chamfer_full", "occupancy_bce"):
            best = min(table, key=lambda method: table[method][name].mean)
            assert best == "SIMstack"
