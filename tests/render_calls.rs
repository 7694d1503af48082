//! What a scene calls for where paths are followed one at a time, and what of its description amounts to nothing.
#![allow(clippy::expect_used)] // these are tests

mod common;
mod furnace_support;

use std::sync::Arc;

use common::{picture_by, scene, scene_with};
use furnace_support::Opaque;
use goniofit::brdf::Reflectance;
use goniofit::image::compare;
use goniofit::render::{Material, Materials, Plan, Scene};

const HEAD: &str =
    "version = 1\nname = \"t\"\nmax_bounces = 5\n[camera]\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nfov_deg = 40\n";
const BALL: &str = "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n";

/// A scene whose material `m` is opaque.
fn opaque(rest: &str) -> Scene {
    let brdf = Opaque(Arc::new(Reflectance::lobes(vec![0.3; 3], [(vec![0.4; 3], 30.0)])));
    let materials = Materials::from([("m".to_owned(), Material::Brdf(Arc::new(brdf)))]);
    scene_with(&format!("{HEAD}[materials]\nm = {{ file = \"table.csv\" }}\n{rest}"), &materials)
}

#[test]
fn a_table_alone_under_its_lights_casts_no_shadow_and_sees_nothing_of_itself() {
    let lights = [
        "[[light.quad]]\ncenter = [0, 3, 1]\nu = [1, 0, 0]\nv = [0, 0, 1]\nradiance = [5, 5, 5]\n",
        "[[light.sphere]]\ncenter = [2, 3, 1]\nradius = 0.5\nradiance = [9, 9, 9]\n",
        "[[light.spot]]\nposition = [2, 3, 1]\ndirection = [-2, -3, -1]\nintensity = [50, 50, 50]\ninner_deg = 20\nouter_deg = 30\n",
    ];
    for light in lights {
        let scene = opaque(&format!("{BALL}{light}"));
        let plan = Plan::of(&scene);
        assert!(!plan.shadows && !plan.interreflection && !plan.packets, "{light}: {plan:?}");
        let shot = |plan: Plan, seed: u64| picture_by(plan, &scene, 24, 64, seed).to_image();
        let found = compare(&shot(plan, 1), &shot(Plan::FULL, 2)).expect("one size").significance;
        let found = found.expect("noise is known");
        assert!(!found.differs, "{light}: {found:?}");
    }
    // A floor may be hidden by the ball, a shining ball between two others hides them from each other's lamp.
    let floor = "[[plane]]\npoint = [0, -1, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n";
    for light in lights {
        let plan = Plan::of(&opaque(&format!("{BALL}{floor}{light}")));
        assert!(plan.shadows && plan.interreflection, "{light}: {plan:?}");
    }
    let both = Plan::of(&opaque(&format!("{BALL}{}{}", lights[0], lights[1])));
    assert!(both.shadows && !both.interreflection, "one lamp may hide the other: {both:?}");
}

#[test]
fn what_weighs_nothing_is_not_there() {
    let build = |materials: &str, rest: &str| scene(&format!("{HEAD}[materials]\n{materials}\n{rest}"));
    let lamp = "[[light.quad]]\ncenter = [0, 3, 1]\nu = [1, 0, 0]\nv = [0, 0, 1]\nradiance = [5, 5, 5]\n";
    let on = |scene: &Scene| -> Vec<&'static str> {
        let plan = Plan::of(scene).effects(scene);
        plan.effects.iter().filter(|e| e.on).map(|e| e.name).collect()
    };
    let dim = build(
        "m = { kd = [0.5, 0.5, 0.5], phong = [{ ks = [0, 0, 0], n = 1e5 }] }",
        &format!("{BALL}{lamp}[light.environment]\nradiance = [0, 0, 0]\n"),
    );
    let plain = build("m = { kd = [0.5, 0.5, 0.5] }", &format!("{BALL}{lamp}"));
    assert_eq!(on(&dim), on(&plain));
    assert!(on(&dim).contains(&"closed forms") && !on(&dim).contains(&"glossy lobes"), "{:?}", on(&dim));
    // A floor that reflects nothing sends nothing to the ball.
    let floor = "[[plane]]\npoint = [0, -1, 0]\nnormal = [0, 1, 0]\nmaterial = \"f\"\n";
    let dark = build("m = { kd = [0.5, 0.5, 0.5] }\nf = { kd = [0, 0, 0] }", &format!("{BALL}{floor}{lamp}"));
    assert!(!Plan::of(&dark).interreflection);
}
