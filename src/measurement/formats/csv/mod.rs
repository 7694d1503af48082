//! goniofit's own CSV: `#` lines, a header line, one row a pair of directions.
//!
//! Columns stand in any order: `theta_i_deg`, `phi_i_deg`, `theta_o_deg`, `phi_o_deg`; one per channel, under any other name, in 1/sr; `sigma_<channel>`
//! (≥ 0, 0 is exact), for every channel or none; `common_<k>_<channel>` (1 σ, signed; k in plain digits), component by component
//! for every channel; `row_<channel>` (1 σ, signed, no more than the row's `sigma_<channel>`), the part of σ that the channels of a row share;
//! `weight` (≥ 0); `mask_reason` (`saturated`, `unread`, `shadowed`, `unlit`, or nothing), why a row has no value. An empty value is masked as not
//! measured, `nan` and `inf` as not finite. Comments that mean something:
//!
//! - `# quantity: brdf` (default) or `brdf_cos`;
//! - `# dimension: 2`: the flat world, columns `theta_i_deg` and `theta_o_deg` in [−90, 90], values in 1/rad, masked at ±90, where the
//!   cosine is 0;
//! - `# grid: merl-center` or `merl-edge`: the rows are the MERL grid's 1,458,000 entries in order, which is checked; solid angles and
//!   grid interpolation then work as from a MERL file;
//! - `# weights: solid-angle`: the `weight` column holds the solid angles of a grid.

mod header;
mod read;
mod write;

pub(super) use read::{read, read_directions};
pub(super) use write::{check_channels, write};
pub(crate) use write::{flat_deg, push_number, spherical_deg};

use crate::measurement::MerlAngles;

/// What a file must hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Needs {
    /// Directions; values may be missing.
    Directions,
    /// Directions and at least one channel of values.
    Values,
}

/// Names of the angle columns, in the order written.
const ANGLES: [&str; 4] = ["theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg"];
/// Angle columns of the flat world.
const FLAT_ANGLES: [&str; 2] = ["theta_i_deg", "theta_o_deg"];
/// The names that `# grid:` knows.
const GRIDS: [(&str, MerlAngles); 2] = [("merl-center", MerlAngles::Center), ("merl-edge", MerlAngles::Edge)];
/// The column of why a row has no value.
const MASK_REASON: &str = "mask_reason";
/// What `# weights:` says when the weights are solid angles.
const SOLID_ANGLE: &str = "solid-angle";

/// Whether a column of this name is anything but a channel: such a name can't be given to a channel.
pub(crate) fn is_reserved(name: &str) -> bool {
    const RAW: [&str; 4] = ["kind", "time_s", "exposure_s", "repeat"];
    const PREFIXES: [&str; 6] = ["theta_", "phi_", "sigma_", "common_", "row_", "signal_"];
    name.is_empty()
        || name == "weight"
        || name == MASK_REASON
        || RAW.contains(&name)
        || PREFIXES.iter().any(|p| name.starts_with(p))
}
