#!/usr/bin/env python3
"""Writes the broken measurements beside it, one failure a file, named after it. Deterministic; needs nothing but Python."""
import os

HERE = os.path.dirname(os.path.abspath(__file__))
ANGLES = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg"
ALTA = "#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n#PARAM_OUT INV_STERADIAN\n"
FRED = "type bsdf_data\nformat angles=deg bsdf=value scale=1\n"


def zemax(symmetry="PlaneSymmetrical", scatter="BRDF", rotations="1\n0", radial="3\n0 5 10", rows=None, tis="TIS 0.1\n",
          end="DataEnd\n"):
    rows = "0.3 0.2 0.1\n0.3 0.2 0.1\n" if rows is None else rows
    return (f"Source Measured\nSymmetry {symmetry}\nSpectralContent Monochrome\nScatterType {scatter}\n"
            f"SampleRotation {rotations}\nAngleOfIncidence 1\n30\nScatterAzimuth 2\n0 180\nScatterRadial {radial}\n\n"
            f"Monochrome\nDataBegin\n{tis}{rows}{end}")


FILES = {
    "csv-text-for-number.csv": f"{ANGLES},r\n0,0,10,0,0.1\n0,0,20,0,bright\n",
    "csv-text-for-angle.csv": f"{ANGLES},r\n0,0,ten,0,0.1\n",
    "csv-extra-column.csv": f"{ANGLES},r\n0,0,10,0,0.1\n0,0,20,0,0.1,7\n",
    "csv-missing-cell.csv": f"# a comment\n{ANGLES},r\n0,0,10,0\n",
    "csv-missing-angle-column.csv": "theta_i_deg,theta_o_deg,phi_o_deg,r\n0,10,0,0.1\n",
    "csv-misspelt-angle-column.csv": f"{ANGLES},theta_o,r\n0,0,10,0,10,0.1\n",
    "csv-semicolons.csv": ANGLES.replace(",", ";") + ";r\n0;0;10;0;0,1\n",
    "csv-direction-not-finite.csv": f"{ANGLES},r\n0,0,nan,0,0.1\n",
    "csv-negative-sigma.csv": f"{ANGLES},r,sigma_r\n0,0,10,0,0.1,-0.01\n",
    "csv-sigma-of-unknown-channel.csv": f"{ANGLES},r,sigma_red\n0,0,10,0,0.1,0.01\n",
    "csv-sigma-missing-for-valid-value.csv": f"{ANGLES},r,sigma_r\n0,0,10,0,0.1,0.01\n0,0,20,0,0.1,\n",
    "csv-sigma-for-one-channel-of-two.csv": f"{ANGLES},r,g,sigma_r\n0,0,10,0,0.1,0.1,0.01\n",
    "csv-common-without-number.csv": f"{ANGLES},r,common_r\n0,0,10,0,0.1,0.01\n",
    "csv-common-leading-zero.csv": f"{ANGLES},r,common_01_r\n0,0,10,0,0.1,0.01\n",
    "csv-common-plus-sign.csv": f"{ANGLES},r,common_+1_r\n0,0,10,0,0.1,0.01\n",
    "csv-common-for-one-channel-of-two.csv": f"{ANGLES},r,g,common_2_g\n0,0,10,0,0.1,0.1,0.01\n",
    "csv-theta-out-of-range.csv": f"{ANGLES},r\n0,0,10,0,0.1\n0,0,1000,0,0.1\n",
    "csv-phi-out-of-range.csv": f"{ANGLES},r\n0,-400,10,0,0.1\n",
    "csv-common-not-finite.csv": f"{ANGLES},r,common_1_r\n0,0,10,0,0.1,inf\n",
    "csv-duplicate-column.csv": f"{ANGLES},r,r\n0,0,10,0,0.1,0.1\n",
    "csv-unnamed-column.csv": f"{ANGLES},r,\n0,0,10,0,0.1,\n",
    "csv-no-channel.csv": f"{ANGLES},weight\n0,0,10,0,1\n",
    "csv-no-rows.csv": f"{ANGLES},r\n",
    "csv-only-comments.csv": "# one\n# two\n",
    "csv-unknown-quantity.csv": f"# quantity: luminance\n{ANGLES},r\n0,0,10,0,0.1\n",
    "csv-unknown-dimension.csv": f"# dimension: 4\n{ANGLES},r\n0,0,10,0,0.1\n",
    "csv-flat-angle-out-of-range.csv": "# dimension: 2\ntheta_i_deg,theta_o_deg,r\n0,10,0.1\n0,95,0.1\n",
    "csv-flat-with-azimuth.csv": f"# dimension: 2\n{ANGLES},r\n0,0,10,0,0.1\n",
    "csv-grid-in-flat-world.csv": "# dimension: 2\n# grid: merl-center\ntheta_i_deg,theta_o_deg,r\n0,10,0.1\n",
    "csv-grid-wrong-direction.csv": f"# grid: merl-center\n{ANGLES},r,g,b\n0,0,10,0,0.1,0.1,0.1\n",
    "csv-grid-rows-missing.csv": f"# grid: merl-edge\n{ANGLES},r,g,b\n0,0,0,0,0.1,0.1,0.1\n",
    "csv-negative-weight.csv": f"{ANGLES},r,weight\n0,0,10,0,0.1,-1\n",
    "csv-unknown-mask-reason.csv": f"{ANGLES},r,mask_reason\n0,0,10,0,0.1,\n0,0,20,0,,cloudy\n",
    "csv-mask-reason-beside-a-value.csv": f"{ANGLES},r,mask_reason\n0,0,10,0,0.1,shadowed\n",
    "csv-raw-readings.csv": f"{ANGLES},kind,time_s,exposure_s,repeat,signal_r\n0,0,10,0,sample,0,1,0,1000\n",
    "csv-not-utf8.csv": f"{ANGLES},r\n0,0,10,0,0.1\n".encode() + b"0,0,20,0,\xb50.1\n",
    "alta-no-dim.alta": "#PARAM_IN COS_TH\n0.5 0.1\n",
    "alta-no-parameterisation.alta": "#DIM 1 1\n0.5 0.1\n",
    "alta-dim-contradicts-parameterisation.alta": "#DIM 2 1\n#PARAM_IN COS_TH\n0.5 0.1 0.1\n",
    "alta-dim-not-a-number.alta": "#DIM three 1\n#PARAM_IN COS_TH\n0.5 0.1\n",
    "alta-dim-huge.alta": "#DIM 3 4000000000\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n0.1 0.1 0.1 0.1\n",
    "alta-unknown-input.alta": "#DIM 2 1\n#PARAM_IN STARK_2D\n0.5 0.1 0.1\n",
    "alta-output-not-a-brdf.alta": "#DIM 1 1\n#PARAM_IN COS_TH\n#PARAM_OUT ENERGY\n0.5 0.1\n",
    "alta-rgb-with-one-value.alta": "#DIM 1 1\n#PARAM_IN COS_TH\n#PARAM_OUT RGB_COLOR\n0.5 0.1\n",
    "alta-short-row.alta": ALTA + "0.1 0.2 0.3 0.4\n0.1 0.2 0.3\n",
    "alta-text-for-number.alta": ALTA + "0.1 0.2 0.3 0.4\n0.1 0.2 zero 0.4\n",
    "alta-direction-not-finite.alta": ALTA + "0.1 nan 0.3 0.4\n",
    "alta-in-degrees.alta": ALTA + "0 0 0 0.4\n0 15 0 0.4\n",
    "alta-azimuth-out-of-range.alta": ALTA + "0.1 0.2 6.4 0.4\n",
    "alta-projected-angle-out-of-range.alta": ALTA.replace("TV_TL_DPHI", "TL_TV_PROJ_DPHI") + "0.1 2.5 -2.5 0.4\n",
    "alta-cosine-above-one.alta": "#DIM 1 1\n#PARAM_IN COS_TH\n1.5 0.1\n",
    "alta-no-rows.alta": ALTA,
    "alta-binary.alta": "#DIM 1 1\n#PARAM_IN COS_TH\n#FORMAT binary\n",
    "zemax-transmission.bsdf": zemax(scatter="BTDF"),
    "zemax-unknown-symmetry.bsdf": zemax(symmetry="Round"),
    "zemax-anisotropic.bsdf": zemax(rotations="2\n0 90"),
    "zemax-short-row.bsdf": zemax(rows="0.3 0.2 0.1\n0.3 0.2\n"),
    "zemax-extra-value.bsdf": zemax(rows="0.3 0.2 0.1 0.05\n0.3 0.2 0.1\n"),
    "zemax-text-for-number.bsdf": zemax(rows="0.3 0.2 0.1\n0.3 high 0.1\n"),
    "zemax-row-missing.bsdf": zemax(rows="0.3 0.2 0.1\n"),
    "zemax-cut-before-end.bsdf": zemax(end=""),
    "zemax-no-tis.bsdf": zemax(tis=""),
    "zemax-tis-not-finite.bsdf": zemax(tis="TIS nan\n"),
    "zemax-angles-descend.bsdf": zemax(radial="3\n0 10 5"),
    "zemax-angle-out-of-range.bsdf": zemax(radial="3\n0 5 190"),
    "zemax-count-too-small.bsdf": zemax(radial="2\n0 5 10"),
    "zemax-count-huge.bsdf": zemax(radial="4000000000\n0 5 10"),
    "zemax-count-not-a-number.bsdf": zemax(radial="many\n0 5 10"),
    "fred-row-before-block.txt": FRED + "5 0 0.1\n",
    "fred-four-numbers.txt": FRED + "10 0\n5 0 0.1\n5 0 0.1 0.1\n",
    "fred-text-for-number.txt": FRED + "10 0\n5 0 low\n",
    "fred-angle-not-finite.txt": FRED + "10 0\ninf 0 0.1\n",
    "fred-block-angle-out-of-range.txt": FRED + "-190 0\n5 0 0.1\n",
    "fred-theta-out-of-range.txt": FRED + "10 0\n5 0 0.1\n185 0 0.1\n",
    "fred-phi-out-of-range.txt": FRED + "10 0\n5 365 0.1\n",
    "fred-no-rows.txt": FRED + "10 0\n",
    "fred-direction-cosines.txt": FRED.replace("deg", "sin") + "10 0\n5 0 0.1\n",
    "fred-logarithms.txt": FRED.replace("value", "log") + "10 0\n5 0 -1\n",
    "fred-scale-not-finite.txt": FRED.replace("=1", "=nan") + "10 0\n5 0 0.1\n",
    "fred-no-format-line.txt": "type bsdf_data\n10 0\n5 0 0.1\n",
    "empty-file.csv": "",
    "json-no-measurement.csv": '{"format": "goniofit-material", "version": 1}\n',
    "unknown-text.bsdf": "Once upon a time\n",
    "unknown-binary.binary": b"\x00\xfe\xfd\xfc" * 8,
    "utf16.csv": (ANGLES + ",r\n0,0,10,0,0.1\n").encode("utf-16"),
}

if __name__ == "__main__":
    for name, content in FILES.items():
        with open(os.path.join(HERE, name), "wb") as out:
            out.write(content if isinstance(content, bytes) else content.encode())
