//! The material file: JSON that every command reads and `fit` writes.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::lobe::LobeKind;
use super::material::{LobeTerm, Material, PerChannel};

const FORMAT: &str = "goniofit-material";
const VERSION: u64 = 1;
/// Relative room for rounding at the ends of a parameter's range.
const ROUNDING: f64 = 1e-9;

/// Why a text is no material.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// Not JSON, or not the shape that the format prescribes.
    #[error("not a material file: {0}")]
    Json(#[from] serde_json::Error),
    /// A field holds what it must not.
    #[error("{field}: expected {expected}, found {found}")]
    Field {
        /// Which field.
        field: String,
        /// What may stand there.
        expected: String,
        /// What does.
        found: String,
    },
}

/// How a fit went; the `fit` object of a material file. Uncertainties are one σ.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FitRecord {
    /// `converged`, `at-bound`, `budget` or `max-iterations`.
    pub status: String,
    /// The loss minimised.
    pub loss: String,
    /// `solid-angle`, `uniform` or `sigma`.
    pub weights: String,
    /// The robust loss with its SCALE, if any: `cauchy:2.385`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robust: Option<String>,
    /// The instrument through which the lobes were fitted, if any: what it averages over.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through: Option<String>,
    /// That instrument's name, or its file, as it was typed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument: Option<String>,
    /// The robust loss's s, in the residual's unit: one, or one a channel where channels were fitted apart.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub robust_scale: Vec<f64>,
    /// ε of the relative loss, channel by channel, in the data's unit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub relative_epsilon: Vec<f64>,
    /// The ranges that parameters were held to, as they were asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<String>,
    /// Directions with a positive weight in at least one channel.
    pub samples: u64,
    /// Σ w r² (robust: Σ w s² ρ).
    pub cost: f64,
    /// √(cost / Σ w) over samples and channels.
    pub rmse: f64,
    /// Steps of the nonlinear search.
    pub iterations: u64,
    /// Time of the fit alone, s.
    pub seconds: f64,
    /// Standard errors, lobe by lobe; `null` where undetermined, and for a shape at the end of its range.
    pub standard_error: Vec<LobeRecord<Option<f64>>>,
    /// 95 % intervals, lobe by lobe; one-sided for a shape at the end of its range; `null` where undetermined.
    pub interval_95: Vec<LobeRecord<Option<(f64, f64)>>>,
    /// Parameters that the data do not determine.
    pub undetermined: Vec<String>,
    /// What the user must know.
    pub warnings: Vec<String>,
    /// Correlations of the parameters; left out for more than 40 of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correlation: Option<Correlation>,
    /// What the residuals are made of; none where that can't be told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual: Option<ResidualRecord>,
    /// How far the model's own error moves the parameters: standard errors that take the residuals of neighbours as one error.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub model_error: Vec<LobeRecord<Option<f64>>>,
    /// How much of the light the fit reflects; none in the flat world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<EnergyRecord>,
    /// How the global minimum was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search: Option<SearchRecord>,
    /// The part of the samples that a budget or target allowed, where that was not all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subset: Option<SubsetRecord>,
    /// Standard errors from redrawn data, where they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<BootstrapRecord>,
    /// How the model was chosen, where that was left to the fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<ModelChoice>,
}

/// Models compared, and the one that was taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelChoice {
    /// Its specification.
    pub chosen: String,
    /// Why it was.
    pub reason: String,
    /// All that were compared, simplest first.
    pub candidates: Vec<ModelCandidate>,
    /// Directions that they were compared on, where that was not all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<u64>,
}

/// A model among others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelCandidate {
    /// Its specification.
    pub model: String,
    /// Weights and shapes that it has.
    pub parameters: u64,
    /// Its rmse on the samples that it was fitted to.
    pub rmse: f64,
    /// Its rmse on directions that it was not fitted to, cells of (θi, θo) held out in turn.
    pub held_out_rmse: f64,
    /// Akaike's criterion, corrected for few samples, over the number of independent samples that the residuals are worth; infinite where
    /// they are too few for so many parameters, which a file says by `null`.
    #[serde(deserialize_with = "or_infinite")]
    pub aicc: f64,
    /// Schwarz's criterion, over the same number.
    pub bic: f64,
}

/// A number; `null`, the file's form of what is not finite, is +∞.
fn or_infinite<'de, D: serde::Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    Option::<f64>::deserialize(d).map(|number| number.unwrap_or(f64::INFINITY))
}

/// Correlations between the errors of parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// Their names, in the order of rows and columns.
    pub parameters: Vec<String>,
    /// Rows; `null` where a parameter is undetermined or exact.
    pub matrix: Vec<Vec<Option<f64>>>,
}

/// What the residuals are made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualRecord {
    /// The rmse that noise explains, in the loss's unit.
    pub noise_rmse: f64,
    /// The rmse of the model's own error: √(rmse² − noise²).
    pub model_rmse: f64,
    /// Share of the residuals' variance that is structured, not noise.
    pub structured_share: f64,
    /// Where the noise is known from: `sigma` (the measurement's own) or `neighbours` (how alike residuals of neighbours are).
    pub noise_from: String,
    /// How many independent samples the residuals are worth: by how much more the parameters scatter than if they were (design effect).
    pub effective_samples: f64,
}

/// How much of the light a fit reflects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EnergyRecord {
    /// Polar angles of incidence, degrees.
    pub theta_deg: Vec<f64>,
    /// Directional albedo there, channel by channel.
    pub albedo: Vec<Vec<f64>>,
    /// The largest of all.
    pub largest: f64,
    /// Whether it is at most 1.
    pub conserved: bool,
    /// Whether the fit was held to that.
    pub constrained: bool,
}

/// How the global minimum was looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchRecord {
    /// Starts polished; of a robust fit those whose scale was followed.
    pub starts: u64,
    /// Of them, how many ended in the lowest minimum; of a robust fit, as well as the best, by scale and cost.
    pub reached: u64,
    /// Distinct minima seen.
    pub minima: u64,
    /// Cost of the second lowest minimum over the lowest's, less 1.
    pub runner_up_excess: Option<f64>,
    /// Chance that another random start would find a minimum not seen before (Boender & Rinnooy Kan 1987); none where the cost was bracketed
    /// over the whole range of its one shape.
    pub unseen_chance: Option<f64>,
}

/// A fit to a part of the samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SubsetRecord {
    /// Directions fitted.
    pub samples: u64,
    /// Directions there are.
    pub of: u64,
    /// By which share the rmse over all samples is expected to exceed that of a fit to all.
    pub rmse_excess: f64,
    /// What it exceeds with probability 5 % at most.
    pub rmse_excess_95: f64,
}

/// Standard errors from redrawn data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BootstrapRecord {
    /// Data sets drawn.
    pub replicates: u64,
    /// Standard deviation of each parameter over them.
    pub standard_error: Vec<LobeRecord<Option<f64>>>,
}

/// One number (or pair) for each parameter of a lobe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound(deserialize = "T: serde::de::DeserializeOwned"))]
pub struct LobeRecord<T> {
    /// Of each channel's weight.
    pub weight: Vec<T>,
    /// Of each shape parameter, by name.
    #[serde(default = "Vec::new", skip_serializing_if = "Vec::is_empty", with = "named")]
    pub shape: Vec<(String, PerChannel<T>)>,
}

/// Name → value pairs as a JSON object in their own order.
mod named {
    use super::{Deserialize, Map, PerChannel, Serialize, Value};
    use serde::{Deserializer, Serializer, de::DeserializeOwned, de::Error as _, ser::Error as _};

    pub fn serialize<T: Serialize, S: Serializer>(list: &[(String, PerChannel<T>)], s: S) -> Result<S::Ok, S::Error> {
        let mut map = Map::new();
        for (name, value) in list {
            map.insert(name.clone(), serde_json::to_value(value).map_err(S::Error::custom)?);
        }
        map.serialize(s)
    }

    pub fn deserialize<'de, T: DeserializeOwned, D: Deserializer<'de>>(
        d: D,
    ) -> Result<Vec<(String, PerChannel<T>)>, D::Error> {
        let map = Map::<String, Value>::deserialize(d)?;
        map.into_iter().map(|(k, v)| Ok((k, serde_json::from_value(v).map_err(D::Error::custom)?))).collect()
    }
}

#[derive(Deserialize)]
struct File {
    channels: Vec<String>,
    lobes: Vec<FileLobe>,
    #[serde(default)]
    fit: Value,
}

#[derive(Deserialize)]
struct FileLobe {
    kind: String,
    weight: Vec<f64>,
    #[serde(default)]
    shape: Option<Map<String, Value>>,
}

impl Material {
    /// The material as the text of a material file.
    ///
    /// # Errors
    /// [`MaterialError::Json`] for a number that JSON has no form for.
    pub fn to_json(&self) -> Result<String, MaterialError> {
        let lobes = self.lobes.iter().map(write_lobe).collect::<Result<Vec<Value>, _>>()?;
        let mut map = Map::new();
        map.insert("format".into(), FORMAT.into());
        map.insert("version".into(), VERSION.into());
        map.insert("model".into(), self.model().into());
        map.insert("channels".into(), serde_json::to_value(&self.channels)?);
        map.insert("lobes".into(), Value::Array(lobes));
        if let Some(fit) = &self.fit {
            map.insert("fit".into(), serde_json::to_value(fit)?);
        }
        Ok(serde_json::to_string_pretty(&map)?)
    }

    /// Reads the text of a material file. Unknown keys are ignored; lobes whose shape is `null` are dropped, and so is a `fit` object
    /// that can't be understood: it only tells how the material was found.
    ///
    /// # Errors
    /// [`MaterialError`] naming the field, what was expected and what was found.
    pub fn from_json(text: &str) -> Result<Self, MaterialError> {
        // Format and version come first: a newer file may not even have the other fields.
        let value: Value = serde_json::from_str(text)?;
        let format = value.get("format").cloned().unwrap_or(Value::Null);
        expect(format == FORMAT, "format", || (format!("\"{FORMAT}\""), format.to_string()))?;
        let version = value.get("version").cloned().unwrap_or(Value::Null);
        let known = version.as_u64().is_some_and(|v| (1..=VERSION).contains(&v));
        expect(known, "version", || (format!("at most {VERSION}"), version.to_string()))?;
        let file: File = serde_json::from_value(value)?;
        let channels = file.channels.len();
        expect(channels > 0, "channels", || ("at least one name".into(), "none".into()))?;
        let mut lobes = Vec::new();
        for (i, lobe) in file.lobes.into_iter().enumerate() {
            lobes.extend(read_lobe(lobe, i, channels)?);
        }
        Ok(Self { channels: file.channels, lobes, fit: serde_json::from_value(file.fit).ok() })
    }
}

fn expect(holds: bool, field: &str, say: impl FnOnce() -> (String, String)) -> Result<(), MaterialError> {
    if holds {
        return Ok(());
    }
    let (expected, found) = say();
    Err(MaterialError::Field { field: field.into(), expected, found })
}

fn write_lobe(term: &LobeTerm) -> Result<Value, MaterialError> {
    let mut map = Map::new();
    map.insert("kind".into(), term.kind.name().into());
    map.insert("weight".into(), serde_json::to_value(&term.weight)?);
    let names = term.kind.lobe().parameters();
    if !names.is_empty() {
        let shape = match &term.shape {
            None => Value::Null,
            Some(values) => {
                let pairs = names.iter().zip(values).map(|(p, v)| Ok((p.name.to_owned(), serde_json::to_value(v)?)));
                Value::Object(pairs.collect::<Result<_, serde_json::Error>>()?)
            }
        };
        map.insert("shape".into(), shape);
    }
    Ok(Value::Object(map))
}

/// The lobe, or `None` where its shape is `null`.
fn read_lobe(lobe: FileLobe, index: usize, channels: usize) -> Result<Option<LobeTerm>, MaterialError> {
    let field = |name: &str| format!("lobes[{index}].{name}");
    let kind = LobeKind::from_name(&lobe.kind).ok_or_else(|| MaterialError::Field {
        field: field("kind"),
        expected: format!("one of {}", LobeKind::ALL.map(LobeKind::name).join(", ")),
        found: format!("\"{}\"", lobe.kind),
    })?;
    let right = lobe.weight.len() == channels && lobe.weight.iter().all(|w| w.is_finite() && *w >= 0.0);
    expect(right, &field("weight"), || (format!("{channels} finite numbers ≥ 0"), format!("{:?}", lobe.weight)))?;
    let parameters = kind.lobe().parameters();
    let Some(values) = lobe.shape else {
        let term = LobeTerm { kind, weight: lobe.weight, shape: Some(Vec::new()) };
        return Ok(parameters.is_empty().then_some(term));
    };
    let mut shape = Vec::new();
    for parameter in parameters {
        let name = field(&format!("shape.{}", parameter.name));
        // Below what a fit looks for a lobe is still one, down to 0; one at the end of its range may have been rounded beyond it.
        let (_, most) = parameter.bounds;
        let is_possible = |x: f64| (0.0..=most * (1.0 + ROUNDING)).contains(&x);
        let value = values.get(parameter.name).cloned().unwrap_or(Value::Null);
        let read = serde_json::from_value::<PerChannel<f64>>(value.clone()).ok().filter(|v| match v {
            PerChannel::Shared(x) => is_possible(*x),
            PerChannel::Each(list) => list.len() == channels && list.iter().all(|x| is_possible(*x)),
        });
        shape.push(read.ok_or_else(|| MaterialError::Field {
            field: name,
            expected: format!("a number from 0 to {most:e}, or {channels} of them"),
            found: value.to_string(),
        })?);
    }
    Ok(Some(LobeTerm { kind, weight: lobe.weight, shape: Some(shape) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material() -> Material {
        Material::new(
            vec!["r".into(), "g".into()],
            vec![(LobeKind::Lambert, vec![0.1, 0.2], vec![]), (LobeKind::Phong, vec![0.3, 1.0 / 3.0], vec![312.5])],
        )
    }

    #[test]
    fn a_material_comes_back_from_its_file_bit_by_bit() {
        let mut m = material();
        m.fit = Some(FitRecord {
            status: "converged".into(),
            standard_error: vec![
                LobeRecord { weight: vec![Some(1e-5), None], shape: vec![] },
                LobeRecord {
                    weight: vec![Some(1e-5); 2],
                    shape: vec![("exponent".into(), PerChannel::Shared(Some(0.4)))],
                },
            ],
            ..FitRecord::default()
        });
        let text = m.to_json().expect("json");
        assert_eq!(Material::from_json(&text).expect("reads"), m);
        m.lobes[1].shape = Some(vec![PerChannel::Each(vec![10.0, 20.0])]);
        assert_eq!(Material::from_json(&m.to_json().expect("json")).expect("reads"), m);
    }

    #[test]
    fn a_lobe_without_shape_is_dropped() {
        let mut m = material();
        m.lobes[1].shape = None;
        let back = Material::from_json(&m.to_json().expect("json")).expect("reads");
        assert_eq!(back.lobes.len(), 1);
    }

    #[test]
    fn unknown_keys_pass_and_wrong_files_are_refused_with_the_field() {
        let text = material().to_json().expect("json");
        assert!(Material::from_json(&text.replacen('{', "{\"new\": 1,", 1)).is_ok());
        for (from, to, says) in [
            ("goniofit-material", "other", "format: expected \"goniofit-material\", found \"other\""),
            ("\"version\": 1", "\"version\": 2", "version: expected at most 1, found 2"),
            ("\"kind\": \"phong\"", "\"kind\": \"ward\"", "lobes[1].kind"),
            ("312.5", "-1", "lobes[1].shape.exponent"),
            ("312.5", "\"sharp\"", "found \"sharp\""),
            ("312.5", "[1, 2, 3]", "lobes[1].shape.exponent"),
            (
                "312.5",
                "1e9",
                "lobes[1].shape.exponent: expected a number from 0 to 1e8, or 2 of them, found 1000000000.0",
            ),
            ("312.5", "1.0001e8", "lobes[1].shape.exponent"),
            ("312.5", "[1, 1e9]", "lobes[1].shape.exponent"),
            ("\"channels\": [", "\"channels\": [\"b\",", "lobes[0].weight: expected 3 finite numbers"),
        ] {
            let wrong = text.replacen(from, to, 1);
            assert_ne!(wrong, text, "{from}");
            let error = Material::from_json(&wrong).expect_err(to).to_string();
            assert!(error.contains(says), "{error} lacks {says}");
        }
        for end in ["1e8", "1.000000000000001e8", "0.01", "1e-3", "0"] {
            assert!(Material::from_json(&text.replacen("312.5", end, 1)).is_ok(), "{end}");
        }
        assert!(Material::from_json("[]").is_err() && Material::from_json("").is_err());
    }
}
