//! The parts of a gonioreflectometer. Every number that is not given is that of an ideal part, so that its effect is off.
//!
//! Sizes are what the experimenter knows. Errors (`*_u…`) are standard uncertainties of what nobody knows: each simulated instrument has its own
//! draw from a normal distribution of that σ (GUM type B), the same in all its readings.

/// Seconds of the detector's shortest useful exposure.
const LEAST: f64 = 1e-9;
/// Metres of the smallest diameter and of the shortest distance.
const NARROWEST_M: f64 = 1e-6;
const NEAREST_M: f64 = 1e-3;
/// Degrees a second of the slowest axis: half a turn takes two days.
const SLOWEST: f64 = 1e-3;

/// The source and its beam.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Source {
    /// Full angle of the cone in which light reaches a point of the sample, degrees: of a collimated beam the divergence, of a lamp its diameter
    /// over its distance.
    pub divergence_deg: f64,
    /// Diameter of the beam across it at the sample, m: a disc of even irradiance; 0 is a point that is never cut.
    pub beam_diameter_m: f64,
    /// Distance at which irradiance falls as 1/r², m, and from which each point of the spot sees the source; 0 is a collimated beam, which does not.
    pub distance_m: f64,
    /// Full width at half maximum of the triangular band of wavelengths that is lit and read, nm; matters where channels are wavelengths.
    pub bandwidth_nm: f64,
    /// Random walk of the power, relative standard deviation after an hour.
    pub drift_per_sqrt_hour: f64,
}

impl Default for Source {
    fn default() -> Self {
        Self { divergence_deg: 0.0, beam_diameter_m: 0.0, distance_m: 0.0, bandwidth_nm: 0.0, drift_per_sqrt_hour: 0.0 }
    }
}

/// The sample on its holder.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Holder {
    /// Diameter of the sample, a disc, m; 0 is one that catches every beam.
    pub diameter_m: f64,
    /// Standard uncertainty of the surface's height over the axes' crossing, m.
    pub height_u_m: f64,
    /// Standard uncertainty of the normal's tilt about each of two axes, degrees.
    pub tilt_u_deg: f64,
}

/// The detector.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Detector {
    /// Full angle of the cone that the aperture takes in, seen from the sample, degrees.
    pub aperture_deg: f64,
    /// Distance from the sample, m; 0 is far away, or behind a lens that sees all of the spot in one direction. Matters to a spot that has a size, and
    /// where the sample's height is uncertain.
    pub distance_m: f64,
    /// Diameter of the field of view across it at the sample, m; 0 sees all of the sample.
    pub field_diameter_m: f64,
    /// Dark current, electrons a second.
    pub dark_per_s: f64,
    /// Random walk of the dark current, electrons a second, standard deviation after an hour.
    pub dark_drift_per_sqrt_hour: f64,
    /// What the electronics add to each reading, however long its exposure, electrons. Dark and blank are read in all exposures then.
    pub offset: f64,
    /// Electrons at which a reading saturates, or the log's own unit where `electrons` is 0; 0 is never.
    pub full_well: f64,
    /// Bits of the converter, whose last step is full_well/(2^bits − 1); 0 is one without steps.
    pub bits: u32,
    /// Standard uncertainty of the relative nonlinearity at full well: N electrons read as N (1 + δ N/full_well).
    pub nonlinearity_u: f64,
    /// Exposures that a reading may take, s, ascending: the longest that does not saturate is kept.
    pub exposures_s: Vec<f64>,
    /// Standard uncertainty of each of these times, relative: one error for all readings of an exposure, another for those of the next.
    #[serde(skip_serializing_if = "is_none")]
    pub exposure_u: f64,
}

impl Default for Detector {
    fn default() -> Self {
        Self {
            aperture_deg: 0.0,
            distance_m: 0.0,
            field_diameter_m: 0.0,
            dark_per_s: 0.0,
            dark_drift_per_sqrt_hour: 0.0,
            offset: 0.0,
            full_well: 0.0,
            bits: 0,
            nonlinearity_u: 0.0,
            exposures_s: vec![1.0],
            exposure_u: 0.0,
        }
    }
}

/// Whether a number is left out of what is written: descriptions of instruments without it stay what they were.
#[allow(clippy::trivially_copy_pass_by_ref)] // serde hands over a reference
fn is_none(x: &f64) -> bool {
    *x == 0.0
}

/// The reference standard that readings are compared with.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Reference {
    /// Reflectance factor on the certificate, at the geometry it is read at; 0 is no reference: the gain is known.
    pub reflectance: f64,
    /// Its relative standard uncertainty.
    pub reflectance_u: f64,
    /// Geometry that it is read at, degrees.
    pub theta_i_deg: f64,
    /// In the plane of incidence, on the side of the mirror direction.
    pub theta_o_deg: f64,
    /// By how much it falls short of a Lambertian at grazing angles: its BRDF is R/π·(1 + s (cosθi cosθo − c)), c the product at the geometry of
    /// the certificate.
    pub shape: f64,
}

impl Default for Reference {
    fn default() -> Self {
        Self { reflectance: 0.0, reflectance_u: 0.0, theta_i_deg: 0.0, theta_o_deg: 45.0, shape: 0.0 }
    }
}

/// The axes that turn source, sample and detector.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Axes {
    /// Standard uncertainty of each axis's zero (θi, φi, θo, φo), degrees: one error for all readings.
    pub zero_u_deg: f64,
    /// Standard deviation of where an axis stops, degrees: a new error at each stop.
    pub jitter_deg: f64,
    /// Seconds to move to the next pair of directions, however far.
    pub move_s: f64,
    /// How fast an axis turns, degrees a second: the angle that the farthest travels adds its time to `move_s`; 0 adds none.
    pub degrees_per_s: f64,
}

/// Light and shadow that do not belong to the sample.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Surroundings {
    /// Stray light, as the BRDF of a sample that reflects as much at cosθo = 1, 1/sr; blank readings measure it.
    pub stray_per_sr: f64,
    /// Directions closer together than this can't be measured, degrees: source and detector shadow each other.
    pub shadow_deg: f64,
}

/// The order in which things are read.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Protocol {
    /// The reference, the blank and the dark are read before every so many pairs of directions, and at the end.
    pub block: u32,
    /// How many times they are read then, each.
    pub repeats: u32,
}

impl Default for Protocol {
    fn default() -> Self {
        Self { block: 500, repeats: 16 }
    }
}

/// Says what is wrong with the first number that is out of its range.
fn check(part: &str, numbers: &[(&str, f64, f64)]) -> Option<String> {
    let wrong = |(_, value, most): &&(&str, f64, f64)| !(0.0..=*most).contains(value);
    numbers.iter().find(wrong).map(|(name, value, most)| {
        format!("instrument.{part}.{name}: expected a number from 0 to {}, found {}", shown(*most), shown(*value))
    })
}

/// Says what is wrong with the first number that is neither 0, which means `none`, nor from the least to the most.
fn check_or_none(part: &str, numbers: &[(&str, f64, f64, f64)], none: &str) -> Option<String> {
    let wrong = |(_, value, least, most): &&(&str, f64, f64, f64)| *value != 0.0 && !(*least..=*most).contains(value);
    numbers.iter().find(wrong).map(|(name, value, least, most)| {
        let [least, most, value] = [least, most, value].map(|x| shown(*x));
        format!("instrument.{part}.{name}: expected 0 ({none}) or a number from {least} to {most}, found {value}")
    })
}

/// A number in a message, with an exponent where its plain form is long.
pub(super) fn shown(x: f64) -> String {
    let plain = x == 0.0 || (1e-4..1e6).contains(&x.abs()) || !x.is_finite();
    if plain { format!("{x}") } else { format!("{x:e}") }
}

/// 1 over a distance, 1/m; 0 of what is far away, whose distance is 0.
fn nearness(distance_m: f64) -> f64 {
    if distance_m > 0.0 { 1.0 / distance_m } else { 0.0 }
}

impl Source {
    /// 1 over its distance, 1/m; 0 of a collimated beam.
    #[must_use]
    pub fn nearness(&self) -> f64 {
        nearness(self.distance_m)
    }

    /// Half angle of the cone in which light reaches a point of the sample, rad.
    #[must_use]
    pub fn half_angle(&self) -> f64 {
        0.5 * self.divergence_deg.to_radians()
    }

    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let Self { divergence_deg, beam_diameter_m, distance_m, bandwidth_nm, drift_per_sqrt_hour } = *self;
        let (beam, far) = (("beam_diameter_m", beam_diameter_m), ("distance_m", distance_m));
        check(
            "source",
            &[
                ("divergence_deg", divergence_deg, 60.0),
                ("bandwidth_nm", bandwidth_nm, 1e4),
                ("drift_per_sqrt_hour", drift_per_sqrt_hour, 1.0),
            ],
        )
        .or_else(|| check_or_none("source", &[(beam.0, beam.1, NARROWEST_M, 100.0)], "a spot that is never cut"))
        .or_else(|| check_or_none("source", &[(far.0, far.1, NEAREST_M, 1e6)], "a collimated beam"))
    }
}

impl Holder {
    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let Self { diameter_m, height_u_m, tilt_u_deg } = *self;
        let numbers = [("height_u_m", height_u_m, 1.0), ("tilt_u_deg", tilt_u_deg, 10.0)];
        let size = [("diameter_m", diameter_m, NARROWEST_M, 100.0)];
        check("sample", &numbers).or_else(|| check_or_none("sample", &size, "it catches every beam"))
    }
}

impl Detector {
    /// 1 over its distance, 1/m; 0 where it is far away.
    #[must_use]
    pub fn nearness(&self) -> f64 {
        nearness(self.distance_m)
    }

    /// Half angle of the cone that the aperture takes in, rad.
    #[must_use]
    pub fn half_angle(&self) -> f64 {
        0.5 * self.aperture_deg.to_radians()
    }

    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let numbers = [
            ("aperture_deg", self.aperture_deg, 60.0),
            ("dark_per_s", self.dark_per_s, 1e15),
            ("dark_drift_per_sqrt_hour", self.dark_drift_per_sqrt_hour, 1e15),
            ("offset", self.offset, 1e15),
            ("bits", f64::from(self.bits), 32.0),
            // From a quarter on no signal is safe from saturation.
            ("nonlinearity_u", self.nonlinearity_u, 0.2),
            ("exposure_u", self.exposure_u, 0.2),
        ];
        let (far, field) = (("distance_m", self.distance_m), ("field_diameter_m", self.field_diameter_m));
        let well = [("full_well", self.full_well, 1e-12, 1e18)];
        let rising = self.exposures_s.windows(2).all(|e| e[0] < e[1]);
        let possible = self.exposures_s.iter().all(|e| (LEAST..=1e6).contains(e));
        check("detector", &numbers)
            .or_else(|| check_or_none("detector", &[(far.0, far.1, NEAREST_M, 1e6)], "far away"))
            .or_else(|| check_or_none("detector", &[(field.0, field.1, NARROWEST_M, 100.0)], "it sees everything"))
            .or_else(|| check_or_none("detector", &well, "never saturates"))
            .or_else(|| {
                let good = rising && possible && !self.exposures_s.is_empty();
                let found = &self.exposures_s;
                (!good).then(|| {
                    format!(
                        "instrument.detector.exposures_s: expected one or more times from {LEAST:e} to 1e6 s, ascending, found {found:?}"
                    )
                })
            })
            .or_else(|| {
                let needs = (self.bits > 0 || self.nonlinearity_u > 0.0) && self.full_well == 0.0;
                needs.then(|| "instrument.detector.full_well: bits and nonlinearity_u are stated of it, found 0".into())
            })
    }
}

impl Reference {
    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let Self { reflectance, reflectance_u, theta_i_deg, theta_o_deg, shape } = *self;
        let numbers = [
            // The factor of a white at 0/45 is a few per cent above 1.
            ("reflectance", reflectance, 1.2),
            ("reflectance_u", reflectance_u, 0.2),
            ("theta_i_deg", theta_i_deg, 80.0),
            ("theta_o_deg", theta_o_deg, 80.0),
            ("shape", shape, 1.0),
        ];
        check("reference", &numbers)
    }
}

impl Axes {
    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let Self { zero_u_deg, jitter_deg, move_s, degrees_per_s } = *self;
        let slowest = (degrees_per_s > 0.0 && degrees_per_s < SLOWEST).then(|| {
            format!("instrument.axes.degrees_per_s: expected 0 (moves take move_s alone) or from {SLOWEST} to 1e6, found {degrees_per_s:e}")
        });
        let numbers = [
            ("zero_u_deg", zero_u_deg, 10.0),
            ("jitter_deg", jitter_deg, 10.0),
            ("move_s", move_s, 1e6),
            ("degrees_per_s", degrees_per_s, 1e6),
        ];
        check("axes", &numbers).or(slowest)
    }
}

impl Surroundings {
    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let Self { stray_per_sr, shadow_deg } = *self;
        check("surroundings", &[("stray_per_sr", stray_per_sr, 100.0), ("shadow_deg", shadow_deg, 90.0)])
    }
}

impl Protocol {
    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let zero = if self.block == 0 { "block" } else { "repeats" };
        (self.block == 0 || self.repeats == 0)
            .then(|| format!("instrument.protocol.{zero}: expected at least 1, found 0"))
    }
}
