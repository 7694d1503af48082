//! What accuracy of a picture costs: samples, the plan of effects, depth, sampler, how lights are found, how finely the
//! material was measured.

use std::time::Instant;

use super::curve::{About, Beside, Sweep, curves, words};
use super::design::{Cost, Law, Measure, Series, Setting, Theory};
use super::knob::Knob;
use super::sweep::{Effort, Runs, Trial, limited, run};
use crate::chain::{self, ChainError, Stage};
use crate::control::Control;
use crate::image::{Image, compare};
use crate::render::{self, Material, Options, Plan, Scene, Strategy};

pub(super) mod accumulate;
mod judges;
mod resolution;

use accumulate::Gathered;
use judges::{Judges, seen_whole};
pub use resolution::{Tables, scanned};

/// What is swept.
#[derive(Debug, Clone)]
pub struct RenderSweep {
    /// Width and height of the pictures, pixels.
    pub size: (u32, u32),
    /// Samples per pixel.
    pub samples: Vec<u32>,
    /// Relative errors asked for, as by `--target-error`.
    pub targets: Vec<f64>,
    /// Ways to render; the scene's own plan first.
    pub ways: Vec<Way>,
    /// Samples per pixel of each half of the reference; 4 times the most of `samples` where none is said.
    pub reference: Option<u32>,
    /// Tables of the subject to render in its place, at the most of `samples`.
    pub tables: Tables,
}

/// A way to render a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// By the plan of effects that the scene calls for.
    Scene,
    /// Everything on, one path at a time.
    Full,
    /// At most so many scattering events.
    Depth(u32),
    /// Lights found by one of the two ways alone, instead of both.
    Lights(Strategy),
    /// Blocks of points that know nothing of each other, as far as the film can: the mean of pictures of few samples, each
    /// with a seed of its own.
    Independent,
}

/// Samples of the pictures of [`Way::Independent`], one block of packets.
const FEW: u32 = 8;
/// Times the most samples that half of the reference has.
const BETTER: u32 = 4;
/// Bytes of a GiB, and those that all sums of pictures may take.
const GIB: f64 = (1u64 << 30) as f64;
const ROOM: f64 = 4.0 * GIB;

/// The errors that each trial tells, so that advice can be asked for.
pub const TOLD: [&str; 2] = ["error", "flip"];

/// The last is of tables alone.
const MEASURES: [Measure; 5] = [
    Measure { name: "error", what: "root of the mean of (x − truth)²/(truth² + (L̄/10)²)" },
    Measure { name: "noise", what: "its part that differs from seed to seed" },
    Measure { name: "bias", what: "its part that all seeds share" },
    Measure { name: "flip", what: "mean ꟻLIP against the reference" },
    Measure { name: "unmeasured", what: "error of the material's picture without what a table does not hold" },
];
const BIAS: usize = 2;

const SOBOL: Law = Law {
    theory: Theory::AtMost(-0.5),
    why: "scrambled Sobol' points are at least as good as independent ones, better the smoother the light",
};
const INDEPENDENT: Law = Law { theory: Theory::Exactly(-0.5), why: "independent blocks of 8 samples" };

impl Way {
    fn name(self) -> String {
        match self {
            Self::Scene => "plan of the scene".into(),
            Self::Full => "full integrator".into(),
            Self::Depth(events) => format!("max_bounces = {events}"),
            Self::Lights(Strategy::MaterialOnly) => "lights met by chance".into(),
            Self::Lights(Strategy::LightsOnly) => "lights aimed at only".into(),
            Self::Lights(Strategy::Combined) => "lights found both ways".into(),
            Self::Independent => "independent samples".into(),
        }
    }

    fn law(self) -> Law {
        if self == Self::Independent { INDEPENDENT } else { SOBOL }
    }

    /// What of the samples theory speaks of, where that is not all of them: whole blocks that are independent, more than one.
    fn effective(self, samples: u32) -> Option<f64> {
        let blocks = f64::from(samples.div_ceil(FEW));
        let counted = if blocks > 1.0 { blocks * f64::from(FEW) } else { f64::INFINITY };
        (self == Self::Independent).then_some(counted)
    }

    /// Whether the picture's expected value is the reference's.
    fn is_unbiased(self) -> bool {
        !matches!(self, Self::Depth(_))
    }

    fn options(self, options: Options) -> Options {
        match self {
            Self::Full => Options { plan: Some(Plan::FULL), ..options },
            Self::Lights(strategy) => Options { strategy, ..options },
            _ => options,
        }
    }
}

/// One picture to take.
#[derive(Debug, Clone, Copy)]
struct Shot {
    way: Way,
    /// Which scene: those of the ways, then those of the tables.
    scene: usize,
    /// Which table is in the subject's place.
    table: Option<usize>,
    samples: u32,
    target: Option<f64>,
}

/// Sweeps the knobs of a scene's rendering.
///
/// # Errors
/// [`ChainError`] where the scene can't be built or rendered, or there is no room for so many pictures of this size.
pub fn sweep(
    stage: &Stage,
    subject: Option<&Material>,
    what: &RenderSweep,
    effort: &Effort,
    control: Control<'_>,
) -> Result<Sweep, ChainError> {
    limited(effort, control, |control| swept(stage, subject, what, effort, control))
}

fn swept(
    stage: &Stage,
    subject: Option<&Material>,
    what: &RenderSweep,
    effort: &Effort,
    control: Control<'_>,
) -> Result<Sweep, ChainError> {
    let began = Instant::now();
    let (series, settings) = design(what);
    within_memory(settings.len() + what.tables.all.len(), what.size)?;
    what.tables.check(stage)?;
    let scenes = scenes(stage, subject, what)?;
    let (width, height) = what.size;
    let base = Options { width, height, ..Options::default() };
    let most = most(what);
    let half = what.reference.unwrap_or(most.saturating_mul(BETTER)).min(1 << 24);
    // Seeds that no trial has: those are mixed.
    let judges = Judges::new(stage, subject, &what.tables, |scene, number| {
        let seed = effort.seed.wrapping_add(u64::MAX / 2 + number);
        Ok(render::render(scene, &Options { samples: half, seed, ..base }, control)?.to_image())
    })?;
    let measures = measures(what);
    let mut gathered: Vec<Gathered> = settings.iter().map(|_| Gathered::default()).collect();
    let runs = run(&settings, effort, control, |index, turn| {
        let shot = settings[index].what;
        let options = Options { seed: turn.seed, samples: shot.samples, target_error: shot.target, ..base };
        let (image, seconds) = picture(&scenes[shot.scene], shot.way, &options, control.quiet())?;
        let mut errors = vec![f64::NAN; measures.len()];
        if control.stop.requested() {
            return Ok(Trial { seconds, errors });
        }
        let truth = judges.of(shot.table);
        let image = if shot.table.is_some() { seen_whole(image) } else { image };
        if !turn.again {
            gathered[index].add(truth, &image);
        }
        errors[0] = truth.error(&image);
        errors[3] = compare(&image, truth.image())?.appearance.map_or(f64::NAN, |a| a.flip.mean);
        Ok::<_, ChainError>(Trial { seconds, errors })
    })?;
    let parts = |index: usize, measure: usize| {
        let table = settings[index].what.table;
        match measure {
            1 => gathered[index].noise(judges.of(table)),
            BIAS => gathered[index].bias(judges.of(table)),
            4 => judges.unmeasured(table),
            _ => None,
        }
    };
    let beside = Beside { errors: &parts, untold: judges.of(None).untold() };
    let found = curves(&series, &settings, measures, &runs, &beside);
    let about = About {
        stage: "render",
        subject: format!("{}, {width}×{height}", stage.spec.name),
        commands: vec![words([
            "goniofit",
            "render",
            "--scene",
            &stage.spec.name,
            "--size",
            &format!("{width}x{height}"),
        ])],
        reference: judges.said(half, smallest(&settings, &runs)),
        notes: notes(what, &runs.trials, judges.untold()),
    };
    Ok(about.sweep(measures.to_vec(), found, effort, runs.ended, began))
}

/// The most samples of a pixel that are tried.
fn most(what: &RenderSweep) -> u32 {
    what.samples.iter().copied().max().unwrap_or(FEW)
}

/// What is measured of the settings.
fn measures(what: &RenderSweep) -> &'static [Measure] {
    if what.tables.is_empty() { &MEASURES[..4] } else { &MEASURES }
}

/// The smallest error that was told of the material itself.
fn smallest(settings: &[Setting<Shot>], runs: &Runs) -> f64 {
    let own = settings.iter().zip(&runs.trials).filter(|(setting, _)| setting.what.table.is_none());
    own.flat_map(|(_, trials)| trials).map(|t| t.errors[0]).filter(|e| *e > 0.0).fold(f64::INFINITY, f64::min)
}

/// Refuses sums of pictures, one a setting, that take more than [`ROOM`].
fn within_memory(settings: usize, (width, height): (u32, u32)) -> Result<(), ChainError> {
    let found = settings as f64 * f64::from(width) * f64::from(height) * Gathered::PIXEL as f64;
    if found <= ROOM {
        return Ok(());
    }
    let [found_gib, most_gib] = [found, ROOM].map(|bytes| bytes / GIB);
    Err(ChainError::TooManyPictures { settings, width, height, found_gib, most_gib })
}

fn notes(what: &RenderSweep, trials: &[Vec<Trial>], untold: f64) -> Vec<String> {
    let close = trials.iter().flatten().filter(|t| t.errors[0].is_nan()).count();
    let all: usize = trials.iter().map(Vec::len).sum();
    let unjudged = format!(
        "{close} of {all} trials come too near to the reference to be judged, and their settings have no error: ask for a \
         better one (--reference). Such a trial is off by less than {untold:.1e}, and keeps a promise of more"
    );
    let blocks = format!(
        "independent samples are means of pictures of {FEW} Sobol' points a pixel, each with a seed of its own: of more \
         samples as many whole pictures as hold them, and {FEW} or less take no part in slopes"
    );
    let ends = "a table ends below 90°, and what it does not hold is black: that is what `unmeasured` says, and other errors of \
                tables are against the material without it. The ideal instrument takes a second for each pair of directions"
        .to_owned();
    let said =
        [(close > 0, unjudged), (what.ways.contains(&Way::Independent), blocks), (!what.tables.is_empty(), ends)];
    said.into_iter().filter_map(|(is_so, note)| is_so.then_some(note)).collect()
}

/// One of each way, then one of each table.
fn scenes(stage: &Stage, subject: Option<&Material>, what: &RenderSweep) -> Result<Vec<Scene>, ChainError> {
    let of_ways = what.ways.iter().map(|way| scene(stage, subject, *way));
    let of_tables = what.tables.all.iter().map(|table| chain::scene(stage, Some(table.material.clone())));
    of_ways.chain(of_tables).collect()
}

fn scene(stage: &Stage, subject: Option<&Material>, way: Way) -> Result<Scene, ChainError> {
    let mut stage = stage.clone();
    if let Way::Depth(events) = way {
        stage.spec.max_bounces = events;
    }
    chain::scene(&stage, subject.cloned())
}

/// The series of all ways, and one of targets.
fn design(what: &RenderSweep) -> (Vec<Series>, Vec<Setting<Shot>>) {
    let (mut series, mut settings) = (Vec::new(), Vec::new());
    // Of the ways `render` has options for the scene's own alone.
    let new = |name: String, knob: Knob, laws: Vec<Option<Law>>, way: Way| Series {
        name,
        knob,
        cost: Cost::Computer,
        main: 0,
        laws,
        whole: 0.0,
        advisable: way == Way::Scene,
    };
    for (scene, &way) in what.ways.iter().enumerate() {
        let of_error = Some(way.law()).filter(|_| way.is_unbiased());
        series.push(new(way.name(), Knob::Samples, vec![of_error, Some(way.law()), None, None, None], way));
        for &samples in &what.samples {
            let size = f64::from(samples);
            let text = Knob::Samples.typed(size, 0.0);
            let shot = Shot { way, scene, table: None, samples, target: None };
            let setting = Setting::sized(series.len() - 1, size, text, shot);
            settings.push(Setting { effective: way.effective(samples), ..setting });
        }
    }
    // As `render` does it, by the scene's plan, where that is among the ways.
    let scene = what.ways.iter().position(|way| *way == Way::Scene).unwrap_or(0);
    if !what.targets.is_empty() {
        series.push(new("samples where it is noisy".into(), Knob::PictureTarget, vec![None; 5], what.ways[scene]));
    }
    for &target in &what.targets {
        let shot = Shot { way: what.ways[scene], scene, table: None, samples: 1 << 24, target: Some(target) };
        let text = Knob::PictureTarget.typed(target, 0.0);
        settings.push(Setting { promise: Some(target), ..Setting::sized(series.len() - 1, target, text, shot) });
    }
    add_tables(what, &mut series, &mut settings);
    (series, settings)
}

/// The series of tables: what a finer one takes is the instrument's time, and what it brings is less bias. No one command makes
/// its pictures, and so advice takes none of them.
fn add_tables(what: &RenderSweep, series: &mut Vec<Series>, settings: &mut Vec<Setting<Shot>>) {
    if what.tables.is_empty() {
        return;
    }
    series.push(Series {
        name: "resolution of the table".into(),
        knob: Knob::Resolution,
        cost: Cost::Instrument,
        main: BIAS,
        laws: vec![None, None, what.tables.law, None, None],
        whole: 0.0,
        advisable: false,
    });
    let samples = most(what);
    for (k, table) in what.tables.all.iter().enumerate() {
        let shot = Shot { way: Way::Scene, scene: what.ways.len() + k, table: Some(k), samples, target: None };
        let text =
            [Knob::Resolution.typed(table.step_deg, 0.0), Knob::Samples.typed(f64::from(samples), 0.0)].join(" ");
        let setting = Setting::sized(series.len() - 1, table.step_deg, text, shot);
        settings.push(Setting { instrument_s: Some(table.instrument_s), ..setting });
    }
}

/// A picture and the time of its rendering, s.
fn picture(scene: &Scene, way: Way, options: &Options, control: Control<'_>) -> Result<(Image, f64), ChainError> {
    let shot = |options: &Options| {
        let film = render::render(scene, &way.options(*options), control)?;
        Ok::<_, ChainError>((film.to_image(), film.seconds))
    };
    if way != Way::Independent || options.target_error.is_some() || options.samples <= FEW {
        return shot(options);
    }
    let parts = options.samples.div_ceil(FEW);
    let mut sum: Option<(Image, f64)> = None;
    for part in (0..parts).take_while(|_| !control.stop.requested()) {
        let seed = options.seed.wrapping_add(u64::from(part).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let (image, seconds) = shot(&Options { samples: FEW, seed, ..*options })?;
        match &mut sum {
            None => sum = Some((image, seconds)),
            Some((all, time)) => {
                all.radiance.iter_mut().zip(&image.radiance).for_each(|(a, b)| *a = [0, 1, 2].map(|c| a[c] + b[c]));
                *time += seconds;
            }
        }
    }
    let Some((mut image, seconds)) = sum else { return shot(options) };
    image.radiance.iter_mut().for_each(|p| *p = p.map(|x| x / f64::from(parts)));
    image.standard_error = None;
    Ok((image, seconds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::{BuiltInMaterial, Source};

    #[test]
    fn independent_samples_are_counted_in_blocks() {
        let ways = vec![Way::Scene, Way::Independent];
        let tables = Tables::default();
        let what =
            RenderSweep { size: (8, 8), samples: vec![4, 8, 12, 16], targets: vec![], ways, reference: None, tables };
        let (_, settings) = design(&what);
        let found: Vec<Option<f64>> = settings.iter().map(|s| s.effective).collect();
        let none = f64::INFINITY;
        assert_eq!(found[..4], [None; 4], "Sobol' points count each");
        assert_eq!(found[4..], [none, none, 16.0, 16.0].map(Some));
        assert!(notes(&what, &[], 0.0).concat().contains("pictures of 8 Sobol' points"));
        assert!(notes(&RenderSweep { ways: vec![Way::Scene], ..what }, &[], 0.0).is_empty());
    }

    #[test]
    fn tables_are_rendered_at_the_most_samples_and_no_advice() {
        let satin = Source::Fitted(Box::new(BuiltInMaterial::find("satin").expect("built in").material()));
        let own = chain::render_material("satin", &satin, None).expect("renders");
        let control = Control::silent();
        let tables = Tables::read(("satin", &satin), &own, None, &[30.0, 15.0], control).expect("reads");
        let ways = vec![Way::Full];
        let what =
            RenderSweep { size: (8, 8), samples: vec![4, 16], targets: vec![0.1], ways, reference: None, tables };
        let (series, settings) = design(&what);
        let last = &series[2];
        assert!(last.knob == Knob::Resolution && last.main == BIAS && !last.advisable, "{last:?}");
        let of_tables: Vec<(&str, usize, Option<usize>, Option<f64>)> =
            settings[3..].iter().map(|s| (s.text.as_str(), s.what.scene, s.what.table, s.size)).collect();
        let want = [
            ("--scan hemisphere:30 --samples 16", 1, Some(0), Some(30.0)),
            ("--scan hemisphere:15 --samples 16", 2, Some(1), Some(15.0)),
        ];
        assert_eq!(of_tables, want);
        let names = |what: &RenderSweep| measures(what).iter().map(|m| m.name).collect::<Vec<_>>();
        assert_eq!(names(&what), ["error", "noise", "bias", "flip", "unmeasured"]);
        assert_eq!(names(&RenderSweep { tables: Tables::default(), ..what })[..], ["error", "noise", "bias", "flip"]);
    }

    #[test]
    fn more_pictures_than_there_is_room_for_are_refused_with_both_numbers() {
        // 4 GiB are 178.96 million pixels of 24 bytes.
        assert!(within_memory(178, (1000, 1000)).is_ok());
        for (settings, size, found) in [(179, (1000, 1000), "4.0"), (6, (16384, 16384), "36.0")] {
            let said = within_memory(settings, size).expect_err("too many").to_string();
            let (width, height) = size;
            for part in [
                format!("{settings} settings of {width}×{height}"),
                "at most 4.0 GiB".into(),
                format!("found {found};"),
            ] {
                assert!(said.contains(&part), "{part}: {said}");
            }
        }
    }
}
