//! One household shape, and the embedded set of fixed ones.

use std::path::Path;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::family::{Family, Split};
use crate::error::ObjectError;
use crate::mesh::TriMesh;
use crate::object::{Object, ObjectSpec};

/// A member of a family: parameter values in the order of [`Family::parameters`].
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Identity in results.
    pub id: String,
    /// What it is.
    pub family: Family,
    /// Seen or unseen.
    pub split: Split,
    /// Parameter values, metres (or ratios).
    pub values: Vec<f64>,
}

/// Fixed members of each family: two seen, one unseen.
const MEMBERS: [Split; 3] = [Split::Seen, Split::Seen, Split::Unseen];

impl Family {
    /// Fixed member `i` (0 and 1 seen, 2 unseen) of the embedded set.
    ///
    /// # Panics
    /// If `i > 2`.
    pub fn member(self, i: usize) -> Shape {
        let mut rng = stream(&format!("embedded-v1/{}/{i}", self.name()));
        self.draw(MEMBERS[i], format!("{}_{i}", self.name()), &mut rng)
    }

    /// Variant number `index` of this family under `seed`: as many as a trainer wants.
    pub fn variant(self, split: Split, seed: u64, index: u64) -> Shape {
        let side = if split == Split::Seen {
            "seen"
        } else {
            "unseen"
        };
        let id = format!("{}_{side}_{seed}_{index}", self.name());
        let mut rng = stream(&format!("variant-v1/{id}"));
        self.draw(split, id, &mut rng)
    }
}

fn stream(name: &str) -> ChaCha8Rng {
    ChaCha8Rng::from_seed(*blake3::hash(name.as_bytes()).as_bytes())
}

impl Shape {
    /// The watertight mesh, metres.
    ///
    /// # Errors
    /// Never for values in their ranges; a tested property of every family.
    pub fn mesh(&self) -> Result<TriMesh, ObjectError> {
        let path = Path::new(&self.id);
        TriMesh::from_raw(self.family.skin(&self.values), path).map(|(mesh, _)| mesh)
    }

    /// The object with its real mass.
    ///
    /// # Errors
    /// As [`Shape::mesh`].
    pub fn object(&self) -> Result<Object, ObjectError> {
        let path = Path::new(&self.id);
        let (mesh, report) = TriMesh::from_raw(self.family.skin(&self.values), path)?;
        let spec = ObjectSpec {
            id: Some(self.id.clone()),
            mesh: path.to_owned(),
            density_kg_m3: Some(self.family.density_kg_m3()),
            ..ObjectSpec::default()
        };
        Object::from_mesh(&spec, mesh, report)
    }
}

/// The embedded set, sorted by id: three fixed members of each family.
pub fn embedded() -> Vec<Shape> {
    let mut shapes: Vec<Shape> = Family::ALL
        .into_iter()
        .flat_map(|f| (0..MEMBERS.len()).map(move |i| f.member(i)))
        .collect();
    shapes.sort_by(|a, b| a.id.cmp(&b.id));
    shapes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mass::MassProperties;

    #[test]
    fn every_variant_is_one_watertight_body_of_plausible_mass() {
        for family in Family::ALL {
            let variants = (0..3).map(|i| family.member(i)).chain(
                (0..40).map(|i| family.variant([Split::Seen, Split::Unseen][i as usize % 2], 7, i)),
            );
            for shape in variants {
                let raw = family.skin(&shape.values);
                let (mesh, report) = TriMesh::from_raw(raw, Path::new(&shape.id)).unwrap();
                assert!(report.is_watertight(), "{shape:?} {report:?}");
                assert_eq!(report.bodies, 1, "{shape:?}");
                assert!(report.mends().is_empty(), "{shape:?} {:?}", report.mends());
                let mass = MassProperties::of_mesh(&mesh).with_density(family.density_kg_m3());
                assert!(
                    (0.004..1.5).contains(&mass.mass_kg),
                    "{} weighs {} kg",
                    shape.id,
                    mass.mass_kg
                );
            }
        }
    }

    #[test]
    fn the_skin_encloses_its_winding() {
        // A skin that crossed itself would wind twice around some point.
        for shape in embedded() {
            let object = shape.object().unwrap();
            let (lo, hi) = object.surface.mesh().bounds();
            for i in 0..200u32 {
                let f = |k: u32| f64::from((i * k) % 199) / 199.0;
                let p = lo + (hi - lo).component_mul(&nalgebra::Vector3::new(f(37), f(71), f(113)));
                let w = object.surface.winding_number(&p);
                assert!(
                    (w - w.round()).abs() > 1e-6 || (0.0..=1.0).contains(&w.round()),
                    "{} winds {w} times around {p}",
                    shape.id
                );
            }
        }
    }

    #[test]
    fn the_set_is_split_by_the_leading_parameter() {
        let shapes = embedded();
        assert_eq!(shapes.len(), 36);
        for shape in &shapes {
            let (_, lo, hi) = shape.family.parameters()[0];
            let u = (shape.values[0] - lo) / (hi - lo);
            assert_eq!(shape.split == Split::Unseen, u > 0.72, "{shape:?}");
        }
    }
}
