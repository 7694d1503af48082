//! The ranges of the lights' fields.

use super::super::RenderError;
use super::light_spec::{EnvironmentSpec, LightsSpec, SpotLightSpec};
use super::validate::Check;

/// Checks every field of the lights.
pub(super) fn validate_lights(check: &Check<'_>, lights: &LightsSpec) -> Result<(), RenderError> {
    for (i, l) in lights.point.iter().enumerate() {
        check.finite(&format!("light.point[{i}].position"), l.position)?;
        check.color(&format!("light.point[{i}].intensity"), l.intensity)?;
    }
    for (i, l) in lights.directional.iter().enumerate() {
        check.direction(&format!("light.directional[{i}].toward"), l.toward)?;
        check.color(&format!("light.directional[{i}].irradiance"), l.irradiance)?;
    }
    for (i, l) in lights.spot.iter().enumerate() {
        validate_spot(check, &format!("light.spot[{i}]"), l)?;
    }
    for (i, l) in lights.quad.iter().enumerate() {
        check.finite(&format!("light.quad[{i}].center"), l.center)?;
        check.half_edges(&format!("light.quad[{i}]"), l.u, l.v)?;
        check.color(&format!("light.quad[{i}].radiance"), l.radiance)?;
    }
    for (i, l) in lights.sphere.iter().enumerate() {
        check.finite(&format!("light.sphere[{i}].center"), l.center)?;
        check.radius(&format!("light.sphere[{i}].radius"), l.radius)?;
        check.color(&format!("light.sphere[{i}].radiance"), l.radiance)?;
    }
    for (i, l) in lights.mesh.iter().enumerate() {
        check.color(&format!("light.mesh[{i}].radiance"), l.radiance)?;
        check.placement(&format!("light.mesh[{i}].place"), &l.place)?;
    }
    lights.environment.iter().try_for_each(|e| validate_environment(check, e))
}

fn validate_spot(check: &Check<'_>, place: &str, l: &SpotLightSpec) -> Result<(), RenderError> {
    check.finite(&format!("{place}.position"), l.position)?;
    check.direction(&format!("{place}.direction"), l.direction)?;
    check.color(&format!("{place}.intensity"), l.intensity)?;
    let fits = l.outer_deg > 0.0 && l.outer_deg <= 180.0;
    check.holds(fits, &format!("{place}.outer_deg"), l.outer_deg, "above 0 and at most 180")?;
    let fits = l.inner_deg >= 0.0 && l.inner_deg <= l.outer_deg;
    check.holds(fits, &format!("{place}.inner_deg"), l.inner_deg, "from 0 to `outer_deg`")
}

fn validate_environment(check: &Check<'_>, e: &EnvironmentSpec) -> Result<(), RenderError> {
    let picture = e.file.is_some() || e.builtin.is_some();
    let kinds = [e.radiance.is_some(), e.file.is_some(), e.builtin.is_some()].iter().filter(|given| **given).count();
    let constraint = "exactly one of `radiance`, `file`, `builtin`";
    check.holds(kinds == 1, "light.environment", format_args!("{kinds} kinds of environment"), constraint)?;
    e.radiance.iter().try_for_each(|radiance| check.color("light.environment.radiance", *radiance))?;
    let (scale, turn) = (e.scale.unwrap_or(1.0), e.rotate_deg.unwrap_or(0.0));
    let only_pictures = "left out where there is no `file` or `builtin`";
    check.holds(picture || e.scale.is_none(), "light.environment.scale", scale, only_pictures)?;
    check.holds(picture || e.rotate_deg.is_none(), "light.environment.rotate_deg", turn, only_pictures)?;
    let fits = scale.is_finite() && scale >= 0.0;
    check.holds(fits, "light.environment.scale", scale, "a finite number of at least 0")?;
    check.holds(turn.is_finite(), "light.environment.rotate_deg", turn, "a finite number")
}
