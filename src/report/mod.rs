//! What a run found, for people: plots as files, and one HTML page.
//!
//! In: measurements, fits and the files that a run left in its folder. Out: [`plot::Figure`]s as SVG or PNG, and a page that needs no network and
//! no other file. The one decision to know: every figure is drawn here, as SVG, and a page's script only moves what is already drawn, so a page
//! without scripts, or on paper, still shows it.

mod page;
pub mod plot;
pub mod run;
mod shell;
pub mod views;
mod words;

pub use page::{Written, page};
pub use shell::typed;
