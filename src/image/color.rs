//! Colour spaces of pictures for eyes: linear sRGB, CIE XYZ, CIE L*a*b*, and the linear opponent space YCxCz.

/// A colour, three numbers.
pub(super) type Color = [f64; 3];

/// Linear sRGB to XYZ, white D65 = (0.3127, 0.3290) (IEC 61966-2-1, not rounded).
const TO_XYZ: [Color; 3] = [
    [0.412_390_799_265_959_5, 0.357_584_339_383_878, 0.180_480_788_401_834_3],
    [0.212_639_005_871_510_4, 0.715_168_678_767_756, 0.072_192_315_360_733_7],
    [0.019_330_818_715_591_8, 0.119_194_779_794_625_9, 0.950_532_152_249_660_6],
];

/// The inverse of [`TO_XYZ`].
const FROM_XYZ: [Color; 3] = [
    [3.240_969_941_904_522_6, -1.537_383_177_570_094, -0.498_610_760_293_003_4],
    [-0.969_243_636_280_879_6, 1.875_967_501_507_720_2, 0.041_555_057_407_175_6],
    [0.055_630_079_696_993_66, -0.203_976_958_888_976_5, 1.056_971_514_242_878_6],
];

/// XYZ of white, the colour (1, 1, 1).
const WHITE: Color = [
    TO_XYZ[0][0] + TO_XYZ[0][1] + TO_XYZ[0][2],
    TO_XYZ[1][0] + TO_XYZ[1][1] + TO_XYZ[1][2],
    TO_XYZ[2][0] + TO_XYZ[2][1] + TO_XYZ[2][2],
];

/// Luminance of linear sRGB (Rec. ITU-R BT.709).
pub(super) fn luminance(p: Color) -> f64 {
    0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]
}

fn times(m: &[Color; 3], p: Color) -> Color {
    [0, 1, 2].map(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2])
}

/// XYZ over that of white.
fn relative_xyz(linear: Color) -> Color {
    let xyz = times(&TO_XYZ, linear);
    [0, 1, 2].map(|i| xyz[i] / WHITE[i])
}

/// CIE 1976 L*a*b* of linear sRGB, white D65.
pub(super) fn lab(linear: Color) -> Color {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = relative_xyz(linear).map(f);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// L*a*b* without its cube root: a linear opponent space, so that filtering keeps means (Andersson et al. 2020, section 4.1).
pub(super) fn ycxcz(linear: Color) -> Color {
    let [x, y, z] = relative_xyz(linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The inverse of [`ycxcz`].
pub(super) fn from_ycxcz(p: Color) -> Color {
    let y = (p[0] + 16.0) / 116.0;
    let relative = [y + p[1] / 500.0, y, y - p[2] / 200.0];
    times(&FROM_XYZ, [0, 1, 2].map(|i| relative[i] * WHITE[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_matrices_undo_each_other() {
        for p in [[1.0, 0.0, 0.0], [0.2, 0.7, 0.1], [1.0; 3]] {
            let back = from_ycxcz(ycxcz(p));
            assert!((0..3).all(|c| (back[c] - p[c]).abs() < 1e-12), "{p:?} {back:?}");
        }
    }

    #[test]
    fn lab_of_the_primaries_is_as_published() {
        // D65 with four digits of x and y moves published values by some hundredths.
        for (rgb, want) in [
            ([1.0; 3], [100.0, 0.0, 0.0]),
            ([0.0; 3], [0.0; 3]),
            ([1.0, 0.0, 0.0], [53.24, 80.09, 67.20]),
            ([0.0, 1.0, 0.0], [87.73, -86.18, 83.18]),
            ([0.0, 0.0, 1.0], [32.30, 79.19, -107.86]),
        ] {
            let got = lab(rgb);
            assert!((0..3).all(|c| (got[c] - want[c]).abs() < 0.03), "{rgb:?}: {got:?} vs {want:?}");
        }
    }
}
