use super::*;
use crate::brdf::{LobeKind, Material};
use crate::chain::{BuiltInMaterial, Source, measure};
use crate::control::Control;
use crate::fit::{FitOptions, fit};
use crate::gonio::{Instrument, Scan};

fn paint() -> Measurement {
    let material = BuiltInMaterial::find("glossy-paint").expect("built in").material();
    let scan = Scan::Hemisphere { step_deg: 10.0 };
    let instrument = Instrument::default();
    measure("paint", &Source::Fitted(Box::new(material)), &instrument, &scan, 1, Control::silent()).expect("measures")
}

#[test]
fn the_cells_together_are_the_fits_own_cost() {
    let table = paint();
    for model in ["lambert", "lambert+phong"] {
        for loss in Loss::ALL {
            let options = FitOptions { loss, ..FitOptions::new(model.parse().expect("a model")) };
            let material = fit(&table, &options).expect("fits").material;
            let record = material.fit.clone().expect("a record");
            let maps = residual_maps(&table, &Predicted::new(&material, None), 80.0);
            assert!((maps.rmse / record.rmse - 1.0).abs() < 1e-6, "{model} {loss:?}: {} vs {}", maps.rmse, record.rmse);
            for map in [maps.half_diff.as_ref().expect("of space"), &maps.in_out] {
                let (count, squares): (u64, f64) = (map.count.iter().sum(), map.squares.iter().sum());
                assert_eq!(count, maps.count);
                assert!((squares / record.cost - 1.0).abs() < 1e-6, "{model} {loss:?}: {squares} vs {}", record.cost);
            }
        }
    }
}

#[test]
fn means_over_their_error_are_normal_where_only_noise_is_left_and_not_where_the_model_is_wrong() {
    let table = paint();
    let of = |model: &str| {
        let material = fit(&table, &FitOptions::new(model.parse().expect("a model"))).expect("fits").material;
        let maps = residual_maps(&table, &Predicted::new(&material, None), 80.0);
        let cells: Vec<(f64, u64)> = maps
            .in_out
            .values(Statistic::OverNoise)
            .into_iter()
            .zip(&maps.in_out.count)
            .filter_map(|(z, n)| Some((z?, *n)))
            .collect();
        cells.into_iter().filter(|(_, n)| *n >= 30).map(|(z, _)| z).collect::<Vec<f64>>()
    };
    let mean_square = |z: &[f64]| z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
    let right = of("lambert+phong");
    // z² has mean 1 and variance below 2: five standard errors of its mean over the cells.
    let room = 5.0 * (2.0 / right.len() as f64).sqrt();
    assert!((mean_square(&right) - 1.0).abs() < room, "{} of {} cells", mean_square(&right), right.len());
    let wrong = of("lambert");
    assert!(mean_square(&wrong) > 10.0, "{}", mean_square(&wrong));
}

#[test]
fn a_cell_holds_the_direct_sum_over_its_readings() {
    let table = paint();
    let material = Material::new(
        ["r", "g", "b"].map(str::to_owned).to_vec(),
        vec![(LobeKind::Lambert, vec![0.3, 0.1, 0.1], vec![])],
    );
    let maps = residual_maps(&table, &Predicted::new(&material, None), 80.0);
    let map = &maps.in_out;
    let columns = map.x_deg.len() - 1;
    let (column, row) = (map.x_deg.partition_point(|b| *b <= 30.0) - 1, map.y_deg.partition_point(|b| *b <= -20.0) - 1);
    let (mut sum, mut squares, mut weights, mut count) = ([0.0; 3], [0.0; 3], [0.0; 3], 0);
    let mut totals = [(0.0, 0.0); 3];
    for i in 0..table.len() {
        let (wi, wo) = table.directions.pair(i);
        if theta_of(wi).to_degrees() > 80.0 + 1e-6 || theta_of(wo).to_degrees() > 80.0 + 1e-6 {
            continue;
        }
        let inside = (theta_of(wi).to_degrees() - 30.0).abs() < 5.0
            && (theta_of(wo).to_degrees() - 20.0).abs() < 5.0
            && wi.x * wo.x + wi.y * wo.y > 0.0;
        for c in 0..3 {
            let Some(y) = table.value(c, i) else { continue };
            let w = table.weights.get(i);
            totals[c] = (totals[c].0 + w, totals[c].1 + 1.0);
            if inside {
                let r = wi.z * (material.value(wi, wo)[c] - y);
                sum[c] += w * r;
                squares[c] += w * r * r;
                weights[c] += w;
                count += 1;
            }
        }
    }
    let all = |list: [f64; 3]| (0..3).map(|c| list[c] * totals[c].1 / totals[c].0).sum::<f64>();
    let cell = row * columns + column;
    assert_eq!(map.count[cell], count);
    for (found, want) in
        [(map.sum[cell], all(sum)), (map.squares[cell], all(squares)), (map.weight[cell], all(weights))]
    {
        assert!((found / want - 1.0).abs() < 1e-10, "{found} vs {want}");
    }
    let mean = map.values(Statistic::Mean)[cell].expect("filled");
    assert!((mean - all(sum) / all(weights)).abs() < 1e-12);
}
