// The balance of energy at the skin. The twin of firn-snow/alpine/skin.rs.

const EMISSIVITY: f32 = 0.99;
// [W/(m2 K4)]
const STEFAN_BOLTZMANN: f32 = 5.67e-8;
// [J/(kg K)]
const AIR_HEAT: f32 = 1005.0;
// 0 degrees C [K].
const FREEZING: f32 = 273.15;
// von Karman's constant, squared.
const KARMAN: f32 = 0.16;
const MOST_TURNS: u32 = 4u;
// Albedo of new snow, and of ground.
const FRESH_ALBEDO: f32 = 0.9;
const GROUND_ALBEDO: f32 = 0.2;

struct Skin {
    snow: bool,
    shortwave: f32,
    conductance: f32,
    top: Eliminated,
    turbulence: Turbulence,
}

struct Balance {
    skin: f32,
    melt: f32,
    vapour: f32,
}

struct Trial {
    rest: f32,
    slope: f32,
    vapour: f32,
}

// What turbulent exchange owes to the instruments and the wind. The twin of firn-snow/alpine/turbulence.rs.
struct Turbulence {
    // Coefficient of exchange where air and skin are equally warm.
    neutral: f32,
    // Richardson's number for each kelvin by which the air is warmer than the skin.
    stratification: f32,
    // What stirs air that is colder than the skin.
    stirring: f32,
}

fn turbulence_over(weather: WeatherStep, snow: bool, depth: f32) -> Turbulence {
    var wind_height = weather.wind_height;
    var air_height = weather.temperature_height;
    if (weather.flags & ABOVE_GROUND) != 0u {
        wind_height = max(wind_height - depth, 0.5);
        air_height = max(air_height - depth, 0.5);
    }
    let roughness = select(0.05, 0.005, snow);
    let drag = log(wind_height / roughness);
    return Turbulence(
        KARMAN / (drag * log(10.0 * air_height / roughness)),
        GRAVITY * wind_height * wind_height
            / (air_height * (weather.air + FREEZING) * weather.wind * weather.wind),
        75.0 * KARMAN / (drag * drag) * sqrt(wind_height / roughness),
    );
}

// Coefficient of exchange where the air is so much warmer than the skin [K].
fn exchange_of(turbulence: Turbulence, warmer: f32) -> f32 {
    let richardson = turbulence.stratification * warmer;
    if richardson >= 0.0 {
        let capped = min(richardson, 0.1);
        return turbulence.neutral / (1.0 + 15.0 * capped * sqrt(1.0 + 5.0 * capped));
    }
    let stirred = 1.0 + turbulence.stirring * sqrt(-richardson);
    return turbulence.neutral * (1.0 - 15.0 * richardson / stirred);
}

// Heat that is conducted from the skin down [W/m2].
fn conducted(it: Skin, skin: f32) -> f32 {
    return it.conductance * ((1.0 - it.top.bound) * skin - it.top.free);
}

fn balance_at(it: Skin, weather: WeatherStep, skin: f32) -> Trial {
    let kelvin = skin + FREEZING;
    let exchange = weather.air_density * weather.wind * exchange_of(it.turbulence, weather.air - skin);
    let law = select(vec2(17.5043, 241.3), vec2(22.4422, 272.186), skin < 0.0);
    let humidity = 0.622 * 611.213 * exp(law.x * skin / (law.y + skin)) / weather.pressure;
    let rise = humidity * law.x * law.y / ((law.y + skin) * (law.y + skin));
    var vapour = exchange * (humidity - weather.humidity);
    // Ground gives off less than water does.
    let wet = select(1.0, 0.3, !it.snow && vapour > 0.0);
    vapour *= wet;
    let latent = select(VAPORISATION, VAPORISATION + FUSION, it.snow && skin < 0.0);
    let sent = STEFAN_BOLTZMANN * kelvin * kelvin * kelvin;
    let rest = it.shortwave + EMISSIVITY * (weather.longwave - sent * kelvin)
        - exchange * AIR_HEAT * (skin - weather.air) - latent * vapour - conducted(it, skin);
    let slope = 4.0 * EMISSIVITY * sent + exchange * AIR_HEAT + latent * (exchange * rise * wet)
        + it.conductance * (1.0 - it.top.bound);
    return Trial(rest, slope, vapour);
}

fn solve(it: Skin, weather: WeatherStep, before: f32) -> Balance {
    var skin = select(before, min(before, 0.0), it.snow);
    var thawed = skin == 0.0 && it.snow;
    for (var turn = 0u; turn < MOST_TURNS; turn++) {
        let trial = balance_at(it, weather, skin);
        if thawed {
            if trial.rest >= 0.0 {
                return Balance(skin, trial.rest, trial.vapour);
            }
            skin = -0.01;
            thawed = false;
            continue;
        }
        let step = clamp(trial.rest / trial.slope, -10.0, 10.0);
        skin += step;
        thawed = it.snow && skin > 0.0;
        if thawed {
            skin = 0.0;
        } else if abs(step) < 0.005 {
            break;
        }
    }
    let last = balance_at(it, weather, skin);
    if thawed && last.rest < 0.0 {
        return Balance(-0.01, 0.0, balance_at(it, weather, -0.01).vapour);
    }
    return Balance(skin, select(0.0, last.rest, thawed), last.vapour);
}
