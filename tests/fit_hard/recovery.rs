//! Data without noise give the parameters back, from no start value.

use goniofit::brdf::Material;
use goniofit::fit::{FitOptions, Loss, WeightMode};
use goniofit::gonio::Scan;
use goniofit::measurement::Measurement;

use crate::support::*;

/// How far rounding the data to f64 moves the solution, relative to each parameter: the standard deviation of J⁺ dy with each value's dy
/// even within half a unit of its last place, J by the formulas of the reference.
pub fn data_rounding(m: &Measurement, o: &FitOptions, truth: &[f64]) -> f64 {
    use nalgebra::{DMatrix, DVector};
    let reference = crate::reference::Reference::new(m, o);
    let k = truth.len();
    let (mut a, mut b) = (DMatrix::zeros(k, k), DMatrix::zeros(k, k));
    for v in &reference.values {
        let j = reference.jacobian(truth, v);
        let dy = v.cos_i * v.y * f64::EPSILON / 12f64.sqrt();
        a += v.w * &j * j.transpose();
        b += v.w * v.w * dy * dy * &j * j.transpose();
    }
    let scale = DVector::from_fn(k, |i, _| if a[(i, i)] > 0.0 { 1.0 / a[(i, i)].sqrt() } else { 0.0 });
    let scaled = |x: &DMatrix<f64>| DMatrix::from_fn(k, k, |i, j| x[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled(&a).pseudo_inverse(1e-15).expect("symmetric");
    let covariance = &inverse * scaled(&b) * &inverse;
    // Exponents are by their logarithm already.
    let share = |i: usize| covariance[(i, i)].sqrt() * scale[i] / if i < k - 1 { truth[i] } else { 1.0 };
    (0..k).map(share).fold(0.0, f64::max)
}

/// How far rounding one weight to f64 moves the least-squares value of the other, relative to it: by |Aᵢⱼ|/Aᵢᵢ times half a unit of the last
/// place. Beside a sharp peak ten decades higher the diffuse weight has no more digits than that.
fn held_rounding(m: &Measurement, o: &FitOptions, truth: &Material) -> f64 {
    let p = parameters(truth);
    let a = crate::reference::Reference::new(m, o).normal(&p, None);
    let moved = |i: usize, j: usize| a[(i, j)].abs() / a[(i, i)] * 0.5 * f64::EPSILON * p[j] / p[i];
    f64::max(moved(0, 1), moved(1, 0))
}

fn recovers(weights: &[f64], exponents: &[f64], scan: &Scan, o: &FitOptions) -> Vec<String> {
    let mut failures = Vec::new();
    for &kd in weights {
        for &ks in weights {
            for &n in exponents {
                let truth = material(&[kd], &[ks], n);
                let m = exact(&truth, scan);
                let got = solved(&m, o);
                let (data, held) = (data_rounding(&m, o, &parameters(&truth)), held_rounding(&m, o, &truth));
                let bound = f64::max(1e-9, 20.0 * data).max(held);
                let off = worst(&got, &truth);
                let r = record(&got);
                println!(
                    "{scan} kd {kd:e} ks {ks:e} n {n:e}: {off:.1e} of {bound:.1e}, {} {:?}",
                    r.status, r.undetermined
                );
                if !(off <= bound) || r.status != "converged" {
                    failures.push(format!(
                        "{scan} kd {kd:e} ks {ks:e} n {n:e}: {off:.1e} above {bound:.1e}, {:?} {} {:?}",
                        parameters(&got),
                        r.status,
                        r.undetermined
                    ));
                }
            }
        }
    }
    failures
}

const WEIGHTS: [f64; 4] = [1e-6, 1e-3, 0.1, 1.0];

fn assert_none(failures: &[String]) {
    assert!(failures.is_empty(), "{} cases:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn noise_free_data_of_a_merl_grid_give_the_parameters_back() {
    // The table's 1.4 million values take a while: few weights, all exponents.
    assert_none(&recovers(&[1e-6, 1.0], &[0.5, 30.0, 1e6], &Scan::Merl, &options("lambert+phong")));
}

#[test]
fn noise_free_data_of_a_hemisphere_give_the_parameters_back() {
    assert_none(&recovers(&WEIGHTS, &[0.5, 2.0, 30.0, 1e3, 3e3], &HEMISPHERE(7.5), &options("lambert+phong")));
}

#[test]
fn noise_free_data_of_a_fine_hemisphere_give_sharp_lobes_back() {
    assert_none(&recovers(
        &[1e-6, 0.1, 1.0],
        &[3e3, 1e5],
        &part_of(&HEMISPHERE(2.0), |wi, wo| (wi.z > 0.9 || wi.z < 0.3) && cos_alpha(wi, wo) > 0.3),
        &options("lambert+phong"),
    ));
}

#[test]
fn noise_free_data_in_the_plane_of_incidence_give_the_parameters_back() {
    assert_none(&recovers(
        &WEIGHTS,
        &[0.5, 2.0, 30.0, 1e3, 1e5],
        &Scan::InPlane { step_deg: 0.5 },
        &options("lambert+phong"),
    ));
}

#[test]
fn every_loss_weight_and_robust_loss_gives_two_lobes_back_from_noise_free_data() {
    let truth = lobes(0.25, &[(0.1, 9.0), (0.15, 300.0)]);
    let mut m = exact(&truth, &HEMISPHERE(10.0));
    m.sigma = Some(m.values.iter().map(|v| 1e-3 * (0.1 + v.abs()).sqrt()).collect());
    let mut failures = Vec::new();
    for loss in Loss::ALL {
        for robust in robusts() {
            for (weights, use_sigma) in
                [(WeightMode::SolidAngle, false), (WeightMode::Uniform, false), (WeightMode::Uniform, true)]
            {
                let o = FitOptions { loss, robust, weights, use_sigma, ..options("lambert+phong+phong") };
                let got = solved(&m, &o);
                let r = record(&got);
                let off = worst(&got, &truth);
                let case = format!(
                    "{} {} {:?}: {off:.1e}, {}, {} steps",
                    loss.name(),
                    r.weights,
                    robust.map(|r| r.kind),
                    r.status,
                    r.iterations
                );
                println!("{case}");
                if !(off < 1e-9) || r.status != "converged" {
                    failures.push(case);
                }
            }
        }
    }
    assert_none(&failures);
}

/// Between samples that meet the mirror direction exactly a sharp lobe shows its peak alone: kd and the peak ks(n + 2) are known, ks and n are not.
#[test]
fn a_lobe_that_only_its_peak_shows_has_an_open_exponent_and_leaves_the_diffuse_weight_right() {
    let mut failures = Vec::new();
    for kd in WEIGHTS {
        for ks in WEIGHTS {
            for n in [1e5, 1e6] {
                let m = exact(&material(&[kd], &[ks], n), &HEMISPHERE(7.5));
                let got = solved(&m, &options("lambert+phong"));
                let peak = rel(got.lobes[1].weight[0] * (exponent(&got, 1) + 2.0), ks * (n + 2.0));
                // Ten decades lie between the peak and the rest: there the stated error speaks for the diffuse weight.
                let stated = errors(&got)[0].map_or(0.0, |e| 4.0 * e / kd);
                let diffuse = (rel(got.lobes[0].weight[0], kd) - stated).max(0.0);
                let open = undetermined(&got);
                if !(diffuse < 1e-9 && peak < 1e-9 && open == ["phong.weight[r]", "phong.exponent"]) {
                    failures.push(format!("kd {kd:e} ks {ks:e} n {n:e}: kd off by {diffuse:.1e}, peak by {peak:.1e}, open {open:?}, errors {:?}", errors(&got)));
                }
            }
        }
    }
    assert_none(&failures);
}
