//! Transcendental functions whose results depend on the arguments alone.
//!
//! `f64::sin` and similar methods call the platform's mathematics library, which selects a variant by the features of the
//! processor. The last bits differ between machines, and so would a replay. `libm` is compiled from one source. Clippy
//! refuses the methods of `f64` in the rack, and nalgebra uses `libm`, too.
//!
//! Exact operations of IEEE 754 are unaffected: `sqrt`, `abs`, `mul_add`, `round`, `floor`, `%`, `rem_euclid`.

use nalgebra::Complex;

pub use libm::{
    atan2, cos, exp, expm1 as exp_m1, hypot, pow as powf, sin, sincos as sin_cos, tan, tanh,
};

/// Returns the complex number of absolute value 1 at an angle in rad.
pub fn cis(angle: f64) -> Complex<f64> {
    let (sin, cos) = sin_cos(angle);
    Complex::new(cos, sin)
}

#[cfg(test)]
mod tests {
    use nalgebra::ComplexField;

    use super::*;

    type Unary = (fn(f64) -> f64, f64, u64);
    type Binary = (fn(f64, f64) -> f64, f64, f64, u64);

    /// Results of libm 0.2.16. The first one of each function differs from glibc 2.36 on x86-64 with FMA.
    const UNARY: [Unary; 14] = [
        (sin, -5.782_956_8, 0x3fde_b231_8081_179a),
        (sin, 1e22, 0xbfeb_453a_b76b_f397),
        (cos, -6.099_894_6, 0x3fef_76c7_1878_f462),
        (cos, -5.796_299_2, 0x3fec_480a_7978_0667),
        (cos, 1e22, 0x3fe0_be2c_ef01_c8f4),
        (tan, -5.839_736_4, 0x3fde_6669_5585_dde8),
        (tan, 1e22, 0xbffa_0f79_c1b6_b258),
        (exp, -6.099_894_6, 0x3f62_6021_5c2f_0676),
        (exp, 0.3, 0x3ff5_9905_8c8c_1a96),
        (exp_m1, -5.982_119_4, 0xbfef_eb53_e515_e49c),
        (exp_m1, -1e-3, 0xbf50_6035_21ca_c48c),
        (tanh, -1.659_119_8, 0xbfed_c35d_fc1e_6fda),
        (tanh, 1e-3, 0x3f50_624d_7751_6ce2),
        (ComplexField::acos, -0.923_351_661_538_461_5, 0x4005_fae9_e9e2_6daa),
    ];

    const BINARY: [Binary; 5] = [
        (atan2, -6.099_900_8, 1.3, 0xbff5_c5ea_aaab_c6ca),
        (atan2, -6.012_158_4, 1.3, 0xbff5_b9bc_fada_6cad),
        (hypot, -6.099_913_2, 1.3, 0x4018_f296_5274_8aa7),
        (hypot, -6.061_312, 1.3, 0x4018_cbee_dff9_ecf6),
        (powf, 6.099_938, 1.7, 0x4035_a13c_e54f_5b9e),
    ];

    #[test]
    fn results_are_the_same_to_the_last_bit() {
        for (function, x, bits) in UNARY {
            assert_eq!(function(x).to_bits(), bits, "of {x}");
        }
        for (function, x, y, bits) in BINARY {
            assert_eq!(function(x, y).to_bits(), bits, "of {x} and {y}");
        }
    }

    /// Fails if nalgebra calls the platform's library, which differs at one argument in 30 of these.
    #[test]
    fn nalgebra_has_the_same_results() {
        for x in (-10_000..10_000).map(|step| f64::from(step) * 1e-3) {
            let (sin, cos) = sin_cos(x);
            let same = [
                (sin, super::sin(x)),
                (sin, ComplexField::sin(x)),
                (cos, cis(x).re),
                (cos, ComplexField::sin_cos(x).1),
                (hypot(x, 1.3), Complex::new(x, 1.3).modulus()),
                (atan2(x, 1.3), Complex::new(1.3, x).argument()),
                (exp(x), ComplexField::exp(x)),
            ];
            for (one, other) in same {
                assert_eq!(one.to_bits(), other.to_bits(), "at {x}");
            }
        }
    }
}
