"""REST against a real server."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firn import Client, ProblemError
from firn.types import Box, Capsule, ColliderSpec, FootprintSpec, Load, StampSpec

GRID = {"width": 16, "depth": 12, "height": 30, "cell_size": 0.2}


def test_a_sessions_life(client: Client) -> None:
    session = client.create_session(id="life", paused=True, grid=GRID)
    assert session.id == "life" and session.token and session.viewer_token
    fallen = session.snowfall(4, temperature=-8)
    assert math.isclose(fallen["fallen_mass"], 4 * 20 * 16 * 12 * 0.04) and fallen["refused_mass"] == 0
    session.set_air_temperature(-12)
    crate = session.put_collider(
        {"id": "crate", "mass": 300, "shape": {"type": "box", "width": 1, "depth": 1}, "position": {"x": 1.5, "z": 1}}
    )
    assert crate["id"] == "crate" and crate["bottom"] == pytest.approx(4, abs=0.01)
    named = session.put_collider({"mass": 5, "shape": {"type": "disk", "radius": 0.3}, "position": {"x": 2.5, "z": 2}})
    assert sorted(collider["id"] for collider in session.colliders()) == sorted(["crate", named["id"]])

    view = session.step(until_settled=True, max_seconds=600)
    assert view["settled"] and view["tick"] > 0 and view["air_temperature"] == -12
    assert view["state"] == "paused" and view["progress"] is None
    with pytest.raises(ProblemError) as idle:
        session.end_step()
    assert idle.value.status == 409
    sunk = session.collider("crate")
    assert sunk["sink_depth"] > 0 and sunk["resting"]
    session.batch_colliders(delete=[named["id"]])
    session.delete_collider("crate")
    assert list(session.colliders()) == []
    session.clear(1)
    assert session.clear(0.5, path=[(0, 0.3), (2, 0.3)], width=0.4)["cleared_mass"] > 0
    assert session.get()["summary"]["max_height"] <= 1
    assert session.mass()["imbalance_quanta"] == 0
    assert session.usage()["memory_bytes"]["device"] > 0
    assert session.set(time_scale=10)["time_scale"] == 10
    assert session.reset()["tick"] == 0
    session.delete()
    with pytest.raises(ProblemError, match="life") as gone:
        session.get()
    assert gone.value.status == 404


def test_objects_of_any_shape(client: Client) -> None:
    session = client.create_session(paused=True, grid=GRID, initial_snow=[{"depth": 2}])
    foot: Capsule = {"type": "capsule", "length": 0.3, "radius": 0.06}
    feet: list[FootprintSpec] = [
        {"shape": foot, "offset": {"x": -0.12, "z": 0}},
        {"shape": foot, "offset": {"x": 0.12, "z": 0}, "heading": 10},
    ]
    walker: ColliderSpec = {"id": "walker", "mass": 80, "footprints": feet, "position": {"x": 1, "z": 1}, "heading": 90}
    put = session.put_collider(walker)
    assert put.get("shape") is None and [foot["heading"] for foot in put["footprints"]] == [0, 10]
    assert put["heading"] == 90 and put["pressure"] * put["contact_area"] == pytest.approx(80 * 9.81)
    ledge: Box = {"type": "box", "width": 1, "depth": 1}
    over = session.put_collider({"id": "over", "mass": 10, "shape": ledge, "position": {"x": 0, "z": 1}})
    assert over["contact_area"] == pytest.approx(1)

    jump: ColliderSpec = {**walker, "airborne": True}
    lost: ColliderSpec = {"id": "lost", "mass": 1, "shape": ledge, "position": {"x": 99, "z": 1}}
    with pytest.raises(ProblemError, match="/put/1/position"):
        session.batch_colliders([jump, lost])
    results = session.batch_colliders([jump, lost], ["over", "nobody"], on_error="skip").get("results")
    assert results is not None
    assert [(result["id"], result["result"]) for result in results["put"] + results["delete"]] == [
        ("walker", "replaced"),
        ("lost", "skipped"),
        ("over", "removed"),
        ("nobody", "absent"),
    ]
    assert [error["pointer"] for error in results["put"][1]["errors"]] == ["/put/1/position"]
    (held,) = session.colliders()
    assert held["airborne"] and (held["contact_area"], held["pressure"]) == (0, 0)
    assert "results" not in session.batch_colliders(delete=["walker"])
    session.delete()


def test_stamps_leave_prints(client: Client) -> None:
    session = client.create_session(paused=True, preset="game", grid=GRID, initial_snow=[{"depth": 1}])
    sole: Box = {"type": "box", "width": 0.4, "depth": 0.6}
    whole: StampSpec = {"shape": sole, "position": {"x": 1, "z": 1.1}, "mass": 80}
    turned: StampSpec = {
        "shape": {"type": "capsule", "length": 0.6, "radius": 0.2},
        "position": {"x": 2, "z": 1},
        "heading": 30,
        "pressure": 4000,
    }
    first, second = session.stamp([whole, turned], idempotency_key="two steps")
    assert first["depth"] > 0.05 and second["depth"] > 0.05
    heights = session.heights().heights
    assert first["bottom"] == pytest.approx(float(heights[5, 5]))
    assert first["depth"] == pytest.approx(float(heights[0, 0]) - first["bottom"])
    assert list(session.colliders()) == []

    assert session.stamp([whole, turned], idempotency_key="two steps") == [first, second]
    np.testing.assert_array_equal(session.heights().heights, heights)
    with pytest.raises(ProblemError, match="/stamps/1/pressure"):
        session.stamp([whole, {**whole, "pressure": 1}])
    np.testing.assert_array_equal(session.heights().heights, heights)
    session.delete()


def test_long_answers_come_compressed(client: Client) -> None:
    session = client.create_session(paused=True, preset="powder", initial_snow=[{"depth": 1}])
    response = client.request("GET", f"{session.path}/heights", headers={"accept": "application/octet-stream"})
    assert response.headers["content-encoding"] in ("gzip", "zstd")
    assert np.frombuffer(response.content, "<f4") == pytest.approx(np.ones(50 * 50), abs=0.01)
    assert session.get()["material"]["fresh_density"] == 30
    session.delete()


def test_heights_are_arrays(client: Client) -> None:
    session = client.create_session(paused=True, grid=GRID)
    fall = session.snowfall(2, region={"x": 0, "z": 0, "width": 0.4, "depth": 0.2})
    whole = session.heights()
    assert whole.heights.shape == (12, 16) and whole.seq >= fall["seq"] and whole.tick == 0
    assert np.argwhere(whole.heights > 0).tolist() == [[0, 0], [0, 1]]
    assert whole.heights[0, 1] == pytest.approx(2, abs=0.01)
    part = session.heights(column_x=1, column_z=0, width=3, depth=2)
    np.testing.assert_array_equal(part.heights, whole.heights[:2, 1:4])
    assert session.heights(stride=4).heights.shape == (3, 4)
    elevations = np.add.outer(np.arange(12), np.arange(16)) * 0.25
    assert session.put_terrain(elevations)["seq"] > whole.seq
    np.testing.assert_array_equal(session.terrain().heights, elevations.astype(np.float32))
    np.testing.assert_array_equal(session.terrain(stride=4).heights, elevations[::4, ::4])
    np.testing.assert_allclose(session.heights(surface=True).heights, whole.heights + elevations, atol=1e-5)
    assert session.cells(["density"], reference="ground")["density"].shape[1] == session.get()["grid"]["height"]
    assert session.height(0.1, 0.1) == pytest.approx(float(whole.heights[0, 0]))

    column = session.column(1, 0)
    assert column["height"] == pytest.approx(float(whole.heights[0, 1])) and column["layers"]
    cells = session.cells(["density", "fill"], width=3, depth=2, height=4)
    assert cells["density"].shape == (2, 4, 3)
    assert cells["density"][0, 0, 0] == pytest.approx(20) and np.isnan(cells["density"][1, 0, 0])
    (probe,) = session.probe([{"x": 0.1, "z": 0.1, "mass": 1, "area": 0.05}])
    assert probe["sink_depth"] > 0
    load: Load = {"mass": 1, "area": 0.05}
    samples = session.sample([[0.1, 0.1], [0.5, 0.3]], ["sink", "normal", "depth"], load)
    assert samples.fields["sink"][0] == np.float32(probe["sink_depth"])
    assert samples.fields["normal"].shape == (2, 3) and samples.fields["depth"].shape == (2,)
    assert samples.fields["depth"][0] == np.float32(session.height(0.1, 0.1))
    assert set(session.sample([[0.1, 0.1]]).fields) == {"depth", "ground", "elevation", "normal"}


def test_a_snapshot_is_the_same_snow(client: Client) -> None:
    session = client.create_session(id="one", paused=True, grid=GRID, initial_snow=[{"depth": 3, "temperature": -5}])
    session.step(ticks=100)
    kept = session.put_checkpoint("kept")
    assert session.checkpoints() == [kept] and kept["tick"] == 100
    digest, snapshot = session.digest(), session.snapshot()
    session.clear(1)
    assert session.reset(checkpoint="kept")["tick"] == 100 and session.digest() == digest
    session.delete_checkpoint("kept")
    with pytest.raises(ProblemError) as missing:
        session.reset(checkpoint="kept")
    assert missing.value.status == 404
    session.clear(1)
    session.reset(snapshot=snapshot)
    assert session.digest() == digest
    copy = client.restore_session(session.snapshot(), id="two")
    assert copy.digest() == session.digest()
    assert [view["id"] for view in client.sessions()] == ["one", "two"]
    with pytest.raises(ProblemError) as taken:
        client.restore_session(session.snapshot(), id="two")
    assert taken.value.status == 409


def test_pictures(client: Client) -> None:
    session = client.create_session(paused=True, grid=GRID, initial_snow=[{"depth": 2}])
    assert session.profile(3, 4).lstrip().startswith(("<svg", "<?xml"))
    try:
        picture = session.render(view="surface", width=64, height=48)
    except ProblemError as error:
        assert error.status == 501, "a server without a graphics adapter draws nothing"
    else:
        assert picture.startswith(b"\x89PNG")


def test_a_refusal_names_the_fields(client: Client) -> None:
    with pytest.raises(ProblemError, match="-40") as refused:
        client.create_session(air_temperature=4, tick_rate=0)
    problem = refused.value
    assert problem.status == 422 and problem.type == "urn:firn:problem:invalid"
    assert {error.pointer for error in problem.errors} == {"/air_temperature", "/tick_rate"}


def test_an_answer_that_is_no_problem_becomes_one() -> None:
    problem = ProblemError.from_response(502, b"<html>", {"retry-after": "7"})
    assert (problem.status, problem.detail, problem.retry_after) == (502, "HTTP 502", 7)
