"""Alpine snow and its weather, over REST and the stream."""

from __future__ import annotations

import asyncio
from xml.etree import ElementTree

import numpy as np
import pytest

from firn import Client, ProblemError, Session
from firn.types import Event, Site, SiteSpec, Weather, WeatherSeries

COLD: Weather = {"air_temperature": -6, "relative_humidity": 70, "wind_speed": 2, "shortwave": 0}
RAIN: Weather = {"air_temperature": 6, "relative_humidity": 95, "wind_speed": 3, "rainfall": 6, "cloud_cover": 1}
DAVOS: SiteSpec = {"latitude": 46.8, "longitude": 9.8, "start": "2026-03-20T00:00:00Z"}


def alpine(client: Client) -> Session:
    return client.create_session(
        physics="alpine",
        paused=True,
        time_scale=3600,
        grid={"width": 4, "depth": 3, "height": 30, "cell_size": 0.1},
        site=DAVOS,
        weather_step=600,
        weather=COLD,
        initial_snow=[{"depth": 1, "density": 280, "temperature": -1}],
    )


def test_alpine_snow_feels_the_weather(client: Client) -> None:
    session = alpine(client)
    view = session.get()
    assert (view["physics"], view["weather_step"]) == ("alpine", 600)
    site: Site = view["site"]
    assert site["start"] == DAVOS["start"] and site["wind_height"] == 10
    told = session.weather()
    assert told["weather"] == COLD and told["now"]["air_temperature"] == -6
    assert "longwave" in told["derived"] and "shortwave" not in told["derived"]
    assert session.heights(quantity="snow_water_equivalent").heights == pytest.approx(np.full((3, 4), 280))

    put = session.put_weather(RAIN)
    assert session.weather()["seq"] == put["seq"]
    session.step(ticks=120)
    assert session.weather()["steps"] == 12
    column, mass = session.column(1, 2), session.mass()
    assert column["layers"][-1]["liquid_water"] > 0 and column["layers"][0]["hand_hardness"] == "P"
    assert column["skin_temperature"] == 0 and 0 < column["albedo"] < 0.9
    assert column["runoff"] >= 0 and mass["rained"] > 0 and mass["imbalance_quanta"] == 0
    for quantity in ("snow_water_equivalent", "liquid_water", "skin_temperature"):
        read = session.heights(quantity=quantity, column_x=1, column_z=2, width=1, depth=1)
        assert read.heights[0, 0] == pytest.approx(column[quantity], rel=1e-6) and read.seq == column["seq"]
    assert np.nanmax(session.cells(["liquid_water"])["liquid_water"]) > 0

    profile = ElementTree.fromstring(session.snow_profile(1, 2))
    layers = profile.findall(".//{*}stratProfile/{*}Layer")
    assert [layer.findtext("{*}hardness") for layer in layers] == [
        layer["hand_hardness"] for layer in reversed(column["layers"])
    ]


def test_a_series_holds_from_row_to_row(client: Client) -> None:
    session = alpine(client)
    series: WeatherSeries = {"series": [{"at": 0, **COLD}, {"at": 3600, **RAIN}], "interpolate": True}
    session.put_weather(series)
    assert session.weather()["weather"] == series
    session.step(ticks=30)
    assert session.weather()["now"]["air_temperature"] == pytest.approx(0)
    with pytest.raises(ProblemError) as unsorted:
        session.put_weather({"series": [{"at": 60, **COLD}, {"at": 60, **RAIN}]})
    assert [error.pointer for error in unsorted.value.errors] == ["/series/1/at"]


def test_other_snow_feels_none(client: Client) -> None:
    session = client.create_session(paused=True)
    assert "physics" not in session.get() and "albedo" not in session.column(0, 0)
    for refused in (
        session.weather,
        lambda: session.put_weather(COLD),
        lambda: session.heights(quantity="liquid_water"),
        lambda: session.snow_profile(0, 0),
    ):
        with pytest.raises(ProblemError) as error:
            refused()
        assert error.value.status == 409


async def test_weather_comes_and_is_told_over_the_stream(client: Client) -> None:
    session = alpine(client)
    events: asyncio.Queue[Event] = asyncio.Queue()
    async with session.stream(on_event=events.put_nowait) as stream:
        await stream.subscribe(max_rate=60, events=["weather"])
        ack = await stream.command("weather", **RAIN)
        event = await asyncio.wait_for(events.get(), 30)
        assert event["event"] == "weather" and event["seq"] == ack["seq"]
        assert event["now"] == session.weather()["now"] and event["now"]["rainfall"] == 6
        with pytest.raises(ProblemError) as refused:
            await stream.command("weather", **{**RAIN, "wind_speed": -1})
        assert [error.pointer for error in refused.value.errors] == ["/wind_speed"]
