//! What `goniofit` alone says: what it is, and what people start with.

/// The short help, within 80 columns.
pub(super) const TEXT: &str = concat!(
    "goniofit ",
    env!("CARGO_PKG_VERSION"),
    "
Fits reflectance models to measured BRDFs, says how sure the fit is, and shows
what it looks like beside the table itself.

Start with
  demo       the whole chain on a built-in material; needs no input
             goniofit demo --report
  info       what is in a measurement
             goniofit info gold.binary
  fit        an analytic model to a table, with no start value
             goniofit fit gold.binary --out gold.json
  validate   table and fit under the same light, and the difference on one page
             goniofit validate gold.binary gold.json --out gold/ --report
  simulate   a measurement by an instrument with the faults of a real one
             goniofit simulate --material satin --instrument robot --out s.csv
  render     a picture with a material, fitted or measured
             goniofit render --scene cornell --material gold.json --out box.exr

goniofit --help lists all commands, goniofit fit --help the options of one.
"
);
