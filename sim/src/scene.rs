//! What do all trials of an object share? Shapes, masses and the protocol, immutable.

use std::path::Path;

use crate::rapier::math::{Pose, Real};
use crate::rapier::parry::bounding_volume::Aabb;
use crate::rapier::prelude::{MassProperties, SharedShape, TriMeshFlags};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};
use shakedown_gripper_assets::{Gripper, Part};
use shakedown_objects::penetration::{Intruder, Intruders};
use shakedown_objects::pieces::{PieceSettings, decompose_cached};
use shakedown_objects::{ConvexBody, Object, Surface};

use crate::convert;
use crate::grip::Cone;
use crate::protocol::{ObjectContact, ObjectMass, Protocol};

/// Corners of convex pieces.
type Pieces = Vec<Vec<Point3<f64>>>;

/// Why no scene can be made of an object and a hand.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A part of the hand spans no volume.
    #[error("gripper {gripper}: part {part:?} is flat or has too many faces")]
    FlatPart {
        /// The hand.
        gripper: String,
        /// The part.
        part: String,
    },
    /// The object has no usable collision shape.
    #[error("object {object}: {what}")]
    Shape {
        /// The object.
        object: String,
        /// What failed.
        what: String,
    },
}

/// Everything that the trials of one object under one protocol have in common.
#[derive(Clone)]
pub struct Scene {
    /// The protocol.
    pub protocol: Protocol,
    /// Friction coefficient of the pair: the object's own, else the protocol's, times its scale.
    pub friction: f64,
    /// Mass of the object in the trial, kg.
    pub mass_kg: f64,
    /// Force of each finger, N.
    pub grip_force_n: f64,
    /// Parts that the fingers meet: pieces, or triangles of the surface.
    pub contact_parts: usize,
    pub(crate) opening_max_m: f64,
    /// Middle of the pad's face in the finger frame.
    pub(crate) pad_centre_m: Point3<f64>,
    pub(crate) com_m: Point3<f64>,
    pub(crate) object_mass: MassProperties,
    /// About the centre of mass, object axes.
    pub(crate) object_inertia_kg_m2: Matrix3<f64>,
    /// What the fingers meet.
    pub(crate) object_shape: SharedShape,
    /// Corners of the convex pieces, centre of mass at the origin.
    pub(crate) pieces_m: Pieces,
    /// What the palm meets: always convex pieces, as nothing is gripped there.
    pub(crate) object_pieces: SharedShape,
    /// The same pieces one by one.
    pub(crate) piece_shapes: Vec<(Aabb, SharedShape)>,
    /// Which contact normals each triangle allows; none if the fingers meet pieces.
    pub(crate) pseudo_normals: Option<Vec<Option<Cone>>>,
    /// Distance of the farthest point of the object from its centre of mass.
    pub(crate) radius_m: f64,
    /// Convex parts, each a collider of its own: parry mends the contacts of a triangle surface at
    /// its internal edges against a convex shape, but not against a compound.
    pub(crate) palm_shapes: Vec<(Pose, SharedShape)>,
    pub(crate) finger_shapes: Vec<(Pose, SharedShape)>,
    /// All parts of the open hand, hand frame; `finger_parts` are those of left and right.
    pub(crate) hand: Intruders,
    pub(crate) finger_parts: [Vec<usize>; 2],
    pub(crate) surface: Surface,
}

impl Scene {
    /// Prepares an object for trials. `friction` overrides object and protocol; convex pieces go
    /// through the cache in `cache` if one is given.
    ///
    /// # Errors
    /// A hand part or an object that yields no collision shape.
    pub fn new(
        object: &Object,
        gripper: &Gripper,
        protocol: &Protocol,
        friction: Option<f64>,
        cache: Option<&Path>,
    ) -> Result<Self, SceneError> {
        let mass = match protocol.object_mass {
            ObjectMass::Object if object.has_own_mass => object.mass.clone(),
            ObjectMass::Object | ObjectMass::Density => {
                object.mass.with_density(protocol.object_density_kg_m3)
            }
            ObjectMass::Fixed => object.mass.with_mass(protocol.object_mass_kg),
        };
        let mass = mass.with_mass(mass.mass_kg.max(protocol.object_mass_min_kg));
        let com_m = mass.com_m;
        let pieces_m = pieces(object, &com_m, protocol, cache);
        let piece_shapes: Vec<(Aabb, SharedShape)> = pieces_m
            .iter()
            .filter_map(|piece| convex(piece))
            .map(|shape| (shape.compute_local_aabb(), shape))
            .collect();
        let object_pieces = compound(&piece_shapes).ok_or_else(|| SceneError::Shape {
            object: object.id.clone(),
            what: "the convex decomposition is empty; try solver.object_contact=surface".into(),
        })?;
        let (object_shape, contact_parts) = match protocol.solver.object_contact {
            ObjectContact::Pieces => (object_pieces.clone(), pieces_m.len()),
            ObjectContact::Surface => surface_shape(object, &com_m)?,
        };
        let hull = |name: &str, corners: &[Point3<f64>]| {
            ConvexBody::hull(corners).ok_or_else(|| SceneError::FlatPart {
                gripper: gripper.name.clone(),
                part: name.to_owned(),
            })
        };
        let pseudo_normals = object_shape.as_trimesh().map(|mesh| {
            (0..mesh.num_triangles() as u32)
                .map(|i| mesh.triangle_normal_constraints(i).map(|n| Cone::new(&n)))
                .collect()
        });
        let vertices = object.surface.mesh().vertices();
        let radius_m = vertices
            .iter()
            .map(|v| (v - com_m).norm())
            .fold(0.0, f64::max);
        let opening_max_m = gripper.opening_max_m;
        let hand = gripper
            .parts_at(opening_max_m)
            .iter()
            .map(|(name, corners)| hull(name, corners).map(Intruder::new))
            .collect::<Result<Vec<_>, _>>()?;
        let shapes = |parts: &[Part], edge_m: f64| {
            let shape = |part: &Part| {
                part_shape(part, edge_m, is_tip(part, gripper)).ok_or_else(|| {
                    SceneError::FlatPart {
                        gripper: gripper.name.clone(),
                        part: part.name.clone(),
                    }
                })
            };
            parts.iter().map(shape).collect::<Result<Vec<_>, _>>()
        };
        let stated = friction.or(object.friction).unwrap_or(protocol.friction);
        let friction = stated * protocol.friction_scale;
        Ok(Self {
            friction,
            grip_force_n: protocol.grip_force_on(mass.mass_kg, friction),
            mass_kg: mass.mass_kg,
            contact_parts,
            opening_max_m,
            pad_centre_m: Point3::new(0.0, 0.0, (gripper.pad.z_min_m + gripper.pad.z_max_m) / 2.0),
            com_m,
            object_mass: convert::mass_properties(
                &Point3::origin(),
                mass.mass_kg,
                &mass.inertia_kg_m2,
            ),
            object_inertia_kg_m2: convert::sound_inertia(&mass.inertia_kg_m2),
            object_shape,
            object_pieces,
            piece_shapes,
            pseudo_normals,
            radius_m,
            pieces_m,
            palm_shapes: shapes(&gripper.palm, 0.0)?,
            finger_shapes: shapes(&gripper.finger, protocol.finger_edge_m)?,
            finger_parts: [0, 1].map(|side| {
                let first = gripper.palm.len() + side * gripper.finger.len();
                (first..first + gripper.finger.len()).collect()
            }),
            hand: Intruders::new(hand),
            surface: object.surface.clone(),
            protocol: protocol.clone(),
        })
    }

    /// Corners of the convex pieces of the object, object frame, metres.
    pub fn pieces(&self) -> impl Iterator<Item = Vec<Point3<f64>>> {
        let shift = self.com_m.coords;
        let moved = move |piece: &Vec<Point3<f64>>| piece.iter().map(|c| c + shift).collect();
        self.pieces_m.iter().map(moved)
    }

    /// `object_from_body`: the body's origin is the centre of mass, its axes are the object's.
    pub(crate) fn object_from_body(&self) -> Isometry3<f64> {
        Isometry3::from(Translation3::from(self.com_m.coords))
    }
}

/// A box stays a box: its contact with a triangle is found by separating axes, which is sound at
/// any depth, while a hull goes through GJK and EPA, whose normal can tip over in a flat triangle.
///
/// `edge_m` is taken off at both sides and at the tip: what faces the object and the palm stays.
fn part_shape(part: &Part, edge_m: f64, is_tip: bool) -> Option<(Pose, SharedShape)> {
    if part.cuboid.is_some() {
        let (pose, half) = trimmed_box(part, edge_m, is_tip)?;
        let half = half.map(|s| s as Real);
        let shape = SharedShape::cuboid(half.x, half.y, half.z);
        return Some((convert::pose(&pose), shape));
    }
    convex(&part.corners()).map(|shape| (Pose::IDENTITY, shape))
}

/// Pose and half size of a part that is a box, trimmed at its edges.
pub(crate) fn trimmed_box(
    part: &Part,
    edge_m: f64,
    is_tip: bool,
) -> Option<(Isometry3<f64>, Vector3<f64>)> {
    let cuboid = part.cuboid.as_ref()?;
    let tip_m = if is_tip { edge_m } else { 0.0 };
    let size = Vector3::from(cuboid.size_m) - Vector3::new(0.0, 2.0 * edge_m, tip_m);
    let pose = cuboid.pose() * Translation3::new(0.0, 0.0, -tip_m / 2.0);
    (size.min() > 0.0).then_some((pose, size / 2.0))
}

/// Does this part of a finger reach as far as any?
pub(crate) fn is_tip(part: &Part, gripper: &Gripper) -> bool {
    let top_m = |part: &Part| part.corners().iter().map(|c| c.z).fold(f64::MIN, f64::max);
    let tip_m = gripper.finger.iter().map(top_m).fold(f64::MIN, f64::max);
    top_m(part) > tip_m - 1e-6
}

fn convex(corners: &[Point3<f64>]) -> Option<SharedShape> {
    let points: Vec<_> = corners.iter().map(convert::point).collect();
    SharedShape::convex_hull(&points)
}

fn compound(pieces: &[(Aabb, SharedShape)]) -> Option<SharedShape> {
    match pieces {
        [] => None,
        [(_, only)] => Some(only.clone()),
        _ => Some(SharedShape::compound(
            pieces
                .iter()
                .map(|(_, shape)| (Pose::IDENTITY, shape.clone()))
                .collect(),
        )),
    }
}

fn pieces(object: &Object, com: &Point3<f64>, protocol: &Protocol, cache: Option<&Path>) -> Pieces {
    // For the palm alone, where nothing is gripped, a coarse cut is enough.
    let finest = match protocol.solver.object_contact {
        ObjectContact::Pieces => u32::MAX,
        ObjectContact::Surface => 32,
    };
    let settings = PieceSettings {
        resolution: protocol.solver.piece_resolution.min(finest),
        concavity: protocol.solver.piece_concavity,
        max_pieces: protocol.solver.piece_max,
    };
    decompose_cached(object.surface.mesh(), &settings, cache)
        .into_iter()
        .map(|piece| piece.iter().map(|p| p - com.coords).collect())
        .collect()
}

fn surface_shape(object: &Object, com: &Point3<f64>) -> Result<(SharedShape, usize), SceneError> {
    let mesh = object.surface.mesh();
    let points = mesh
        .vertices()
        .iter()
        .map(|v| convert::point(&(v - com.coords)))
        .collect();
    let flags = TriMeshFlags::FIX_INTERNAL_EDGES;
    let shape =
        SharedShape::trimesh_with_flags(points, mesh.faces().to_vec(), flags).map_err(|e| {
            SceneError::Shape {
                object: object.id.clone(),
                what: format!("no collision surface: {e}"),
            }
        })?;
    Ok((shape, mesh.faces().len()))
}
