"""Carried studs against a closed form: pytest benches/peers/test_carried.py"""

import carried
from case import Scene


def test_studs_are_as_the_closed_form_says(tmp_path):
    carried.write(tmp_path, "plane", carried.stretched)
    scene = Scene(tmp_path, 128)
    found, _ = carried.rows(scene, scene.pose(1), carried.FORMS["plane, stretched"][1])
    plain, deform, surface, feature = found
    # The plane is 1 + 0.6 (1 - cos) times as long, 2.2 at most; an edge of a stud is a chord of that.
    assert abs(plain["max"] - 1.2) < 0.02 and abs(deform["max"] - 1.2) < 0.02
    assert feature["max"] < 1e-9 and feature["tilted"] < 1e-3
    assert surface["off"] < 1e-3 < feature["off"] < 1 < plain["off"]
