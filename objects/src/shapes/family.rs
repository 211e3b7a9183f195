//! Which household things there are, how large and how heavy.

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use super::profiles;
use super::shape::Shape;
use crate::mesh::RawMesh;

/// A family of household shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Family {
    /// Cartons of food.
    Box,
    /// Full cans.
    Can,
    /// Full bottles.
    Bottle,
    /// Ceramic mugs with a handle.
    Mug,
    /// Ceramic bowls.
    Bowl,
    /// Ceramic plates.
    Plate,
    /// Table knives.
    Knife,
    /// Spoons.
    Spoon,
    /// Screwdrivers.
    Screwdriver,
    /// Hammers.
    Hammer,
    /// Rings: napkin rings, washers, bracelets.
    Ring,
    /// Hats with a brim.
    Hat,
}

/// Which side of the split by family parameters a shape is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// May be used for training and tuning.
    Seen,
    /// For reports only: the family's leading parameter lies in its upper quarter.
    Unseen,
}

/// A parameter: name, smallest and largest value, metres (or 1 for ratios).
type Range = (&'static str, f64, f64);

impl Family {
    /// All families.
    pub const ALL: [Self; 12] = [
        Self::Box,
        Self::Can,
        Self::Bottle,
        Self::Mug,
        Self::Bowl,
        Self::Plate,
        Self::Knife,
        Self::Spoon,
        Self::Screwdriver,
        Self::Hammer,
        Self::Ring,
        Self::Hat,
    ];

    /// Lower-case name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Can => "can",
            Self::Bottle => "bottle",
            Self::Mug => "mug",
            Self::Bowl => "bowl",
            Self::Plate => "plate",
            Self::Knife => "knife",
            Self::Spoon => "spoon",
            Self::Screwdriver => "screwdriver",
            Self::Hammer => "hammer",
            Self::Ring => "ring",
            Self::Hat => "hat",
        }
    }

    /// Parameters with their ranges; the first leads: it decides between seen and unseen.
    ///
    /// Sizes follow what is sold: a 330 ml can has radius 33 mm and height 115 mm, a table knife is
    /// about 210-240 mm long, a mug 80-105 mm high, and so on.
    pub fn parameters(self) -> &'static [Range] {
        match self {
            Self::Box => &[
                ("depth_m", 0.022, 0.068),
                ("width_m", 0.05, 0.16),
                ("height_m", 0.06, 0.21),
            ],
            Self::Can => &[("radius_m", 0.026, 0.037), ("height_m", 0.06, 0.125)],
            Self::Bottle => &[
                ("radius_m", 0.025, 0.037),
                ("height_m", 0.14, 0.25),
                ("neck_radius_m", 0.010, 0.015),
                ("shoulder", 0.50, 0.66),
            ],
            Self::Mug => &[
                ("radius_m", 0.034, 0.046),
                ("height_m", 0.08, 0.105),
                ("wall_m", 0.0035, 0.0055),
                ("handle_reach_m", 0.024, 0.034),
            ],
            Self::Bowl => &[
                ("radius_m", 0.05, 0.085),
                ("height_m", 0.05, 0.08),
                ("wall_m", 0.0035, 0.006),
            ],
            Self::Plate => &[
                ("radius_m", 0.08, 0.125),
                ("height_m", 0.012, 0.024),
                ("thickness_m", 0.004, 0.006),
            ],
            Self::Knife => &[
                ("length_m", 0.19, 0.25),
                ("handle_width_m", 0.016, 0.022),
                ("handle_thickness_m", 0.006, 0.011),
                ("blade_width_m", 0.014, 0.022),
            ],
            Self::Spoon => &[
                ("length_m", 0.13, 0.21),
                ("stem_width_m", 0.008, 0.012),
                ("thickness_m", 0.0025, 0.004),
                ("bowl_width_m", 0.03, 0.045),
            ],
            Self::Screwdriver => &[
                ("length_m", 0.15, 0.25),
                ("handle_radius_m", 0.011, 0.017),
                ("shaft_radius_m", 0.0025, 0.004),
            ],
            Self::Hammer => &[
                ("length_m", 0.22, 0.30),
                ("handle_width_m", 0.026, 0.034),
                ("head_length_m", 0.08, 0.115),
                ("head_width_m", 0.022, 0.03),
            ],
            Self::Ring => &[("radius_m", 0.018, 0.045), ("tube_radius_m", 0.004, 0.009)],
            Self::Hat => &[
                ("radius_m", 0.075, 0.095),
                ("height_m", 0.09, 0.13),
                ("brim_m", 0.03, 0.06),
                ("wall_m", 0.003, 0.005),
            ],
        }
    }

    /// Density that gives real masses, kg/m3: of the stuff where the shape is solid (ceramic 2300,
    /// steel 7800, felt 250), of the filled whole where it stands for a package or a tool.
    pub fn density_kg_m3(self) -> f64 {
        match self {
            Self::Box => 350.0,
            Self::Can | Self::Bottle => 1000.0,
            Self::Mug | Self::Bowl | Self::Plate => 2300.0,
            Self::Knife => 4000.0,
            Self::Spoon => 7800.0,
            Self::Screwdriver => 1700.0,
            Self::Hammer => 2600.0,
            Self::Ring => 1200.0,
            Self::Hat => 250.0,
        }
    }

    /// The skin of these parameter values, in the order of [`Family::parameters`].
    pub(super) fn skin(self, p: &[f64]) -> RawMesh {
        match self {
            Self::Box => profiles::carton(p[1], p[0], p[2]),
            Self::Can => profiles::can(p[0], p[1]),
            Self::Bottle => profiles::bottle(p[0], p[1], p[2], p[3]),
            Self::Mug => profiles::mug(p[0], p[1], p[2], p[3]),
            Self::Bowl => profiles::bowl(p[0], p[1], p[2]),
            Self::Plate => profiles::plate(p[0], p[1], p[2]),
            Self::Knife => profiles::knife(p[0], p[1], p[2], p[3]),
            Self::Spoon => profiles::spoon(p[0], p[1], p[2], p[3]),
            Self::Screwdriver => profiles::screwdriver(p[0], p[1], p[2]),
            Self::Hammer => profiles::hammer(p[0], p[1], p[2], p[3]),
            Self::Ring => profiles::ring(p[0], p[1]),
            Self::Hat => profiles::hat(p[0], p[1], p[2], p[3]),
        }
    }

    /// A variant drawn by `rng`, on the given side of the split.
    pub fn draw(self, split: Split, id: String, rng: &mut ChaCha8Rng) -> Shape {
        let values = self
            .parameters()
            .iter()
            .enumerate()
            .map(|(i, &(_, lo, hi))| {
                let u: f64 = rng.random();
                let u = match (i, split) {
                    (0, Split::Seen) => 0.7 * u,
                    (0, Split::Unseen) => 0.75 + 0.25 * u,
                    _ => u,
                };
                // Round to 0.1 mm, so that a listed size is the size.
                ((lo + (hi - lo) * u) * 1e4).round() / 1e4
            })
            .collect();
        Shape {
            id,
            family: self,
            split,
            values,
        }
    }
}
