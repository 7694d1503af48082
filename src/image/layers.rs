//! What a picture may hold beside radiance, standard error and mask: one layer a quantity.

/// A quantity of every pixel. Of a rendered picture they are means over the pixel's samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LayerKind {
    /// Directional albedo towards the eye of the surface that is seen first, per channel, 0 to 1: the share of light from there
    /// that it would reflect. Each path adds one random estimate. What has none (a light, Phong's equation, a back, nothing) adds 0.
    Albedo,
    /// Shading normal of the surface that is seen first, a world vector. Where nothing is seen a sample adds 0, so the length is
    /// 1 only where all samples agree.
    Normal,
    /// Distance from the eye to the surface that is seen first, along the ray, metres; a mean over the samples that see one,
    /// +∞ where none does.
    Depth,
    /// Number of samples of the pixel.
    Samples,
    /// Radiance of the light that reaches the eye after at most one scattering event, W/(sr·m²).
    Direct,
    /// Radiance of the light that reaches the eye after two scattering events or more: radiance less [`LayerKind::Direct`].
    Indirect,
    /// Radiance that the Lambert lobe of the surface that is seen first reflects to the eye, direct and indirect light, W/(sr·m²). What has no lobes
    /// (a table, Phong's equation, a light, nothing) adds 0 here and to the next three.
    Diffuse,
    /// The same of its first Phong lobe.
    Glossy1,
    /// The same of its second Phong lobe.
    Glossy2,
    /// The same of its third Phong lobe.
    Glossy3,
    /// Of two pictures: (x − ref)/√(ref² + 0.01), whose mean square is relMSE.
    Relative,
    /// Of two pictures: LDR-ꟻLIP, 0 to 1.
    Flip,
}

impl LayerKind {
    /// All kinds, in the order in which files hold them.
    pub const ALL: [Self; 12] = [
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Samples,
        Self::Direct,
        Self::Indirect,
        Self::Diffuse,
        Self::Glossy1,
        Self::Glossy2,
        Self::Glossy3,
        Self::Relative,
        Self::Flip,
    ];

    /// Names of its channels in an OpenEXR file.
    #[must_use]
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Self::Normal => &["normal.X", "normal.Y", "normal.Z"],
            Self::Depth => &["depth.Z"],
            Self::Samples => &["samples"],
            Self::Direct => &["direct.R", "direct.G", "direct.B"],
            Self::Indirect => &["indirect.R", "indirect.G", "indirect.B"],
            Self::Diffuse => &["diffuse.R", "diffuse.G", "diffuse.B"],
            Self::Glossy1 => &["glossy1.R", "glossy1.G", "glossy1.B"],
            Self::Glossy2 => &["glossy2.R", "glossy2.G", "glossy2.B"],
            Self::Glossy3 => &["glossy3.R", "glossy3.G", "glossy3.B"],
            Self::Relative => &["relative.R", "relative.G", "relative.B"],
            Self::Flip => &["flip"],
        }
    }
}

/// A layer: one plane for each channel of its kind, each with as many values as the picture has pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// What it is.
    pub kind: LayerKind,
    /// Values of [`LayerKind::channels`].
    pub planes: Vec<Vec<f64>>,
}

impl Layer {
    /// A layer of three channels.
    #[must_use]
    pub fn of_colors(kind: LayerKind, colors: &[[f64; 3]]) -> Self {
        Self { kind, planes: (0..3).map(|c| colors.iter().map(|p| p[c]).collect()).collect() }
    }

    /// A layer of one channel.
    #[must_use]
    pub fn of_values(kind: LayerKind, values: Vec<f64>) -> Self {
        Self { kind, planes: vec![values] }
    }
}
