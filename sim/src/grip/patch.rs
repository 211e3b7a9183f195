//! Spots of one finger with about the same normal are one patch of contact: some points that press,
//! and one soft-finger friction for all of them.
//!
//! A patch resists sliding in its plane and twisting about its normal together, up to the limit
//! surface `|f|^2 / (mu N)^2 + tau^2 / (mu N l)^2 <= 1` (R. D. Howe and M. R. Cutkosky, "Practical
//! force-motion models for sliding manipulation", IJRR 1996), with the lever arm `l` of even
//! pressure. Below the limit it gives way elastically (a bristle), so that no load creeps.

use nalgebra::Vector3;
use wide::f32x8;

use super::contact::{PALM, Spot};

/// Spots whose normals differ by less than this, as a cosine, are one patch (15 degrees).
const SAME_NORMAL: f64 = 0.966;
/// Patches of a solid; more different normals than that do not fit on a finger.
const PATCHES_OF_SOLID: usize = 4;
/// Spots nearer to each other than this are one point, metres.
const SAME_POINT_M: f64 = 3e-4;
/// Points of a patch at most.
const POINTS_OF_PATCH: usize = 64;

/// Coordinates of the motion: velocity and angular velocity of the object, speeds of the fingers.
pub(super) type Row = [f64; 8];

/// A point that presses, or will.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub at: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub depth_m: f64,
    pub force_n: f64,
    /// Rate of separation by coordinate.
    pub row: Row,
}

/// A patch of contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patch {
    pub solid: usize,
    pub normal: Vector3<f64>,
    pub tangents: [Vector3<f64>; 2],
    /// Its points, as a range.
    pub first: usize,
    pub last: usize,
    pub centre: Vector3<f64>,
    pub lever_m: f64,
    /// How far the bristle is bent: along both tangents, and twist times lever.
    pub bent_m: [f64; 3],
    /// Friction's limit; what the bristle wants, and its size.
    pub limit_n: f64,
    pub wanted_n: [f64; 3],
    pub held_n: f64,
    /// Rates of sliding by coordinate, as `bent_m`.
    pub rows: [Row; 3],
}

/// Motion of the object at a point along a direction against the motion of a solid of the hand.
pub(super) fn row(
    solid: usize,
    at: &Vector3<f64>,
    direction: &Vector3<f64>,
    com: &Vector3<f64>,
) -> Row {
    let turn = (at - com).cross(direction);
    let mut row = [
        direction.x,
        direction.y,
        direction.z,
        turn.x,
        turn.y,
        turn.z,
        0.0,
        0.0,
    ];
    match solid {
        PALM => {}
        0 => row[6] = -direction.x,
        _ => row[7] = direction.x,
    }
    row
}

/// All points and patches of a trial at one moment.
#[derive(Debug)]
pub(super) struct Patches {
    pub points: Vec<Point>,
    pub patches: Vec<Patch>,
    old: Vec<Patch>,
    open: Vec<usize>,
    members: Vec<usize>,
}

impl Patches {
    /// Room for more than real grasps need, so that no step has to ask for it.
    pub fn new() -> Self {
        let room = 4 * POINTS_OF_PATCH;
        Self {
            points: Vec::with_capacity(room),
            patches: Vec::with_capacity(3 * PATCHES_OF_SOLID),
            old: Vec::with_capacity(3 * PATCHES_OF_SOLID),
            open: Vec::with_capacity(room),
            members: Vec::with_capacity(room),
        }
    }

    /// Groups new spots; patches that go on keep their bristles, limits and middles.
    pub fn group(&mut self, spots: &[Spot], com: &Vector3<f64>) {
        std::mem::swap(&mut self.patches, &mut self.old);
        self.patches.clear();
        let mut points = std::mem::take(&mut self.points);
        points.clear();
        for solid in 0..=PALM {
            self.open.clear();
            self.open
                .extend((0..spots.len()).filter(|&i| spots[i].solid == solid));
            for _ in 0..PATCHES_OF_SOLID {
                let deepest = self.open.iter().copied().reduce(|best, i| {
                    if spots[i].depth_m > spots[best].depth_m {
                        i
                    } else {
                        best
                    }
                });
                let Some(deepest) = deepest else { break };
                let normal = spots[deepest].normal;
                self.members.clear();
                let members = &mut self.members;
                self.open.retain(|&i| {
                    let is_member = spots[i].normal.dot(&normal) > SAME_NORMAL;
                    if is_member {
                        members.push(i);
                    }
                    !is_member
                });
                let patch = patch_of(spots, members, deepest, &mut points, com);
                self.patches.push(patch);
            }
        }
        for patch in &mut self.patches {
            let goes_on = |o: &&Patch| o.solid == patch.solid && o.normal.dot(&patch.normal) > 0.9;
            let near = |o: &&Patch| o.normal.dot(&patch.normal);
            let old = self.old.iter().filter(goes_on);
            if let Some(old) = old.max_by(|a, b| near(a).total_cmp(&near(b))) {
                let bent = old.tangents[0] * old.bent_m[0] + old.tangents[1] * old.bent_m[1];
                let [t1, t2] = &patch.tangents;
                patch.bent_m = [bent.dot(t1), bent.dot(t2), old.bent_m[2]];
                patch.limit_n = old.limit_n;
                patch.lever_m = old.lever_m;
                patch.centre = old.centre;
                patch.set_rows(com);
            }
        }
        self.points = points;
    }

    /// Moves the middle of each patch to its centre of pressure and sets its lever arm. Returns
    /// whether anything moved by more than `tolerance_m`.
    pub fn follow(
        &mut self,
        com: &Vector3<f64>,
        scale: f64,
        least_lever_m: f64,
        tolerance_m: f64,
    ) -> bool {
        let mut moved = false;
        for patch in &mut self.patches {
            let points = &self.points[patch.first..patch.last];
            let total = patch.force_n(&self.points);
            if total <= 0.0 {
                continue;
            }
            let centre = points
                .iter()
                .fold(Vector3::zeros(), |sum, p| sum + p.at * (p.force_n / total));
            let spread: f64 = points
                .iter()
                .map(|p| (p.at - centre).norm() * p.force_n / total)
                .sum();
            let lever_m = (scale * spread).max(least_lever_m);
            if (centre - patch.centre).norm() > tolerance_m
                || (lever_m - patch.lever_m).abs() > tolerance_m
            {
                patch.centre = centre;
                patch.lever_m = lever_m;
                patch.set_rows(com);
                moved = true;
            }
        }
        moved
    }
}

impl Patch {
    /// Sum of what its points press, N.
    pub fn force_n(&self, points: &[Point]) -> f64 {
        points[self.first..self.last]
            .iter()
            .map(|p| p.force_n)
            .sum()
    }

    pub fn set_rows(&mut self, com: &Vector3<f64>) {
        for (k, tangent) in self.tangents.iter().enumerate() {
            self.rows[k] = row(self.solid, &self.centre, tangent, com);
        }
        let twist = self.normal * self.lever_m;
        self.rows[2] = [0.0, 0.0, 0.0, twist.x, twist.y, twist.z, 0.0, 0.0];
    }
}

/// Where the points of a patch lie, eight side by side.
struct Kept {
    at: [[f32x8; 3]; POINTS_OF_PATCH / 8],
    len: usize,
}

impl Kept {
    fn new() -> Self {
        Self {
            at: [[f32x8::splat(f32::MAX); 3]; POINTS_OF_PATCH / 8],
            len: 0,
        }
    }

    /// Adds a point unless one is there already.
    #[inline]
    fn admits(&mut self, at: &Vector3<f64>) -> bool {
        let at = at.map(|x| x as f32);
        let here = [f32x8::splat(at.x), f32x8::splat(at.y), f32x8::splat(at.z)];
        let near = f32x8::splat((SAME_POINT_M * SAME_POINT_M) as f32);
        for [x, y, z] in &self.at[..self.len.div_ceil(8)] {
            let [dx, dy, dz] = [*x - here[0], *y - here[1], *z - here[2]];
            let square = dx * dx + dy * dy + dz * dz;
            if square.simd_le(near).to_bitmask() != 0 {
                return false;
            }
        }
        let block = &mut self.at[self.len / 8];
        for (place, x) in block.iter_mut().zip(at.iter()) {
            place.as_mut_array()[self.len % 8] = *x;
        }
        self.len += 1;
        true
    }
}

/// One patch of its members, the deepest first.
fn patch_of(
    spots: &[Spot],
    members: &[usize],
    deepest: usize,
    points: &mut Vec<Point>,
    com: &Vector3<f64>,
) -> Patch {
    let normal = spots[deepest].normal;
    let side = if normal.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let along = (side - normal * normal.dot(&side)).normalize();
    let first = points.len();
    let mut kept = Kept::new();
    for &i in std::iter::once(&deepest).chain(members) {
        let spot = &spots[i];
        if points.len() - first < POINTS_OF_PATCH && kept.admits(&spot.at) {
            points.push(Point {
                at: spot.at,
                normal: spot.normal,
                depth_m: spot.depth_m,
                force_n: 0.0,
                row: row(spot.solid, &spot.at, &spot.normal, com),
            });
        }
    }
    let kept = &points[first..];
    let sum: Vector3<f64> = kept.iter().map(|p| p.at).sum();
    let mut patch = Patch {
        solid: spots[deepest].solid,
        normal,
        tangents: [along, normal.cross(&along)],
        first,
        last: points.len(),
        centre: sum / kept.len() as f64,
        lever_m: 0.0,
        bent_m: [0.0; 3],
        limit_n: 0.0,
        wanted_n: [0.0; 3],
        held_n: 0.0,
        rows: [[0.0; 8]; 3],
    };
    patch.set_rows(com);
    patch
}
