//! A comparison of two pictures as text, and its metrics by name.

use std::fmt::Write;

use crate::image::{Appearance, Comparison, MeanAndMax, Significance};

/// Metrics that a limit can be set for.
pub(super) const METRICS: [&str; 9] =
    ["rmse", "rel_mse", "max_abs", "max_z", "block_max_z", "flip", "hdr_flip", "delta_e_76", "delta_e_2000"];

/// The value of a metric of [`METRICS`], where it is known.
pub(super) fn metric(c: &Comparison, name: &str) -> Option<f64> {
    let looks = c.appearance.as_ref();
    match name {
        "rmse" => Some(c.rmse),
        "rel_mse" => Some(c.rel_mse),
        "max_abs" => Some(c.max_abs),
        "max_z" => c.significance.as_ref().map(|s| s.max_z),
        "block_max_z" => c.significance.as_ref().map(|s| s.blocks.max_z),
        "flip" => looks.map(|a| a.flip.mean),
        "hdr_flip" => looks.and_then(|a| a.hdr_flip.as_ref()).map(|f| f.mean),
        "delta_e_76" => looks.map(|a| a.delta_e_76.mean),
        _ => looks.map(|a| a.delta_e_2000.mean),
    }
}

/// All numbers in a table of at most 80 columns, then what they mean for the noise.
pub(super) fn describe(c: &Comparison) -> String {
    let mut t = String::new();
    let unit = "W/(sr·m²)";
    let _ = writeln!(t, "pixels     {} compared, {} masked", c.pixels, c.masked);
    let _ = writeln!(t, "rmse       {:.6e} {unit}, largest {:.6e}", c.rmse, c.max_abs);
    let _ = writeln!(t, "relMSE     {:.6e}", c.rel_mse);
    let _ = writeln!(t, "PSNR       {}   peak: largest value of the reference", decibel(c.psnr));
    let rgb = |m: &[f64; 3]| m.map(|x| format!("{x:12.6}")).join(" ");
    let _ = writeln!(t, "mean       {}\nreference  {}", rgb(&c.mean), rgb(&c.reference_mean));
    if let Some(looks) = &c.appearance {
        appearance(&mut t, looks);
    }
    match &c.significance {
        Some(s) => significance(&mut t, s),
        None => t.push_str("whether the difference is noise can't be said\n"),
    }
    if let Some(note) = &c.note {
        let _ = writeln!(t, "note: {note}");
    }
    t
}

fn decibel(psnr: Option<f64>) -> String {
    psnr.map_or("–".into(), |p| format!("{p:.2} dB"))
}

fn appearance(t: &mut String, a: &Appearance) {
    let _ = writeln!(t, "as seen at {:+.2} stops, clipped, sRGB:", a.exposure);
    let _ = writeln!(t, "PSNR       {}   peak: white", decibel(a.psnr));
    let _ = writeln!(t, "SSIM       {:.6}", a.ssim);
    let row = |name: &str, m: &MeanAndMax| format!("{name:10} mean {:.6}, largest {:.6}\n", m.mean, m.max);
    t.push_str(&row("ΔE 1976", &a.delta_e_76));
    t.push_str(&row("ΔE 2000", &a.delta_e_2000));
    t.push_str(&row("ꟻLIP", &a.flip));
    if let Some(hdr) = &a.hdr_flip {
        t.push_str(&row("HDR-ꟻLIP", hdr));
    }
}

fn significance(t: &mut String, s: &Significance) {
    let verdict = if s.differs { "differ by more than their noise" } else { "agree within their noise" };
    let place = place(s.block, s.at);
    let _ = writeln!(t, "the pictures {verdict} (1 % for all tests):");
    let _ = writeln!(t, "largest z  {:.2} in {place}, p {:.2e}", s.max_z, s.p);
    let _ =
        writeln!(t, "pixels     {} of {} beyond their noise; mean z² {:.3}", s.pixels_differing, s.pixels, s.mean_z2);
    let b = &s.blocks;
    let verdict = if b.differs { "beyond" } else { "within" };
    let _ = writeln!(
        t,
        "blocks     means of {0}×{0} pixels {verdict} noise: largest z {1:.2}, p {2:.2e}",
        b.block, b.max_z, b.p
    );
    let (place, d, e) = (self::place(b.block, b.at), b.difference, b.standard_error);
    let _ = writeln!(t, "           {d:+.3e} ± {e:.1e} in {place}");
}

fn place(block: usize, (x, y, channel): (usize, usize, usize)) -> String {
    match block {
        1 => format!("pixel ({x}, {y}), channel {channel}"),
        n => format!("the {n}×{n} pixels from ({x}, {y}), channel {channel}"),
    }
}

/// The difference in one sentence: how many pixels differ by more than noise, and by how much at most.
pub(super) fn sentence(c: &Comparison) -> String {
    let largest = format!("the largest difference is {:.3e} W/(sr·m²)", c.max_abs);
    match (&c.significance, &c.note) {
        (Some(s), _) => format!(
            "{} of {} pixels differ by more than the noise (1 % for all together); {largest}.",
            s.pixels_differing, s.pixels
        ),
        (None, why) => {
            let why = why.as_deref().unwrap_or("the noise is not known");
            format!("Whether pixels differ by more than the noise can't be said ({why}); {largest}.")
        }
    }
}
