//! The skins of the families, each from its named parameters (metres).

use nalgebra::{Point3, Vector3};
use std::f64::consts::{PI, TAU};

use super::loft::{
    Hole, Ring, add_bar, capped, capped_with_holes, circle, closed, ellipse, rounded_rectangle,
};
use crate::mesh::RawMesh;

/// Points around a turned shape.
const AROUND: usize = 32;

fn turned(profile: &[(f64, f64)]) -> RawMesh {
    let rings: Vec<Ring> = profile.iter().map(|&(r, z)| circle(r, z, AROUND)).collect();
    capped(&rings)
}

/// A carton with edges broken by 1.5 mm.
pub fn carton(width: f64, depth: f64, height: f64) -> RawMesh {
    let e = 0.0015;
    let ring = |inset: f64, z| rounded_rectangle(width / 2.0 - inset, depth / 2.0 - inset, e, z, 3);
    capped(&[
        ring(e, 0.0),
        ring(0.0, e),
        ring(0.0, height - e),
        ring(e, height),
    ])
}

/// A full can with a chime at both ends.
pub fn can(radius: f64, height: f64) -> RawMesh {
    let c = 0.0025;
    turned(&[
        (radius - c, 0.0),
        (radius, c),
        (radius, height / 2.0),
        (radius, height - c),
        (radius - c, height),
    ])
}

/// A full bottle with shoulder, neck and cap.
pub fn bottle(radius: f64, height: f64, neck_radius: f64, shoulder: f64) -> RawMesh {
    let body = height * shoulder;
    let neck = height * 0.82;
    let mut profile = vec![
        (radius * 0.92, 0.0),
        (radius, radius * 0.1),
        (radius, body * 0.5),
    ];
    for k in 0..=6 {
        let s = f64::from(k) / 6.0;
        let blend = 0.5 - 0.5 * (PI * s).cos();
        profile.push((
            radius + (neck_radius - radius) * blend,
            body + (neck - body) * s,
        ));
    }
    let cap = neck_radius * 1.12;
    profile.extend([
        (neck_radius, height * 0.9),
        (cap, height * 0.9),
        (cap, height),
    ]);
    turned(&profile)
}

/// A mug with one handle that is joined to the wall, not stuck through it.
pub fn mug(radius: f64, height: f64, wall: f64, handle_reach: f64) -> RawMesh {
    let columns = 36;
    let rows = 14;
    let mut rings: Vec<Ring> = vec![circle(radius * 0.9, 0.0, columns)];
    let first = rings.len();
    for k in 0..=rows {
        let s = k as f64 / rows as f64;
        rings.push(circle(
            radius * (0.97 + 0.03 * s),
            0.004 + (height - 0.006) * s,
            columns,
        ));
    }
    rings.push(circle(radius - wall / 2.0, height, columns));
    rings.push(circle(radius - wall, height - 0.002, columns));
    rings.push(circle(
        radius * 0.97 - wall,
        wall * 1.5 + height * 0.3,
        columns,
    ));
    rings.push(circle(radius * 0.95 - wall, wall * 1.5 + 0.004, columns));
    rings.push(circle(radius * 0.85 - wall, wall * 1.5, columns));
    // The handle leaves and enters through two holes around the angle 0.
    let lower = Hole {
        row: first + 2,
        column: columns - 1,
    };
    let upper = Hole {
        row: first + 10,
        column: columns - 1,
    };
    let start = |h: &Hole| {
        let p = &rings[h.row + 1][0];
        Point3::new(p[0], 0.0, p[2])
    };
    let (a, b) = (start(&lower), start(&upper));
    let mut mesh = capped_with_holes(&rings, &[lower, upper]);
    let index = |h: &Hole| h.border().map(|(i, j)| (i * columns + j % columns) as u32);
    let (low, high) = (index(&lower), index(&upper));
    let last = std::array::from_fn(|k| high[(6 + 8 - k) % 8]);
    let middle = nalgebra::center(&a, &b);
    let rise = (b.z - a.z) / 2.0;
    let path: Vec<Point3<f64>> = (0..=12)
        .map(|k| {
            let angle = -PI / 2.0 + PI * f64::from(k) / 12.0;
            middle
                + Vector3::new(
                    handle_reach * angle.cos().max(0.0).powf(0.7),
                    0.0,
                    rise * angle.sin(),
                )
        })
        .collect();
    add_bar(&mut mesh, &path, &Vector3::y(), (0.006, 0.004), &low, &last);
    mesh
}

/// A bowl: a spherical shell on a foot ring.
pub fn bowl(radius: f64, height: f64, wall: f64) -> RawMesh {
    let arc = |r: f64, h: f64, z0: f64, s: f64| {
        let angle = PI / 2.0 * (0.25 + 0.75 * s);
        (
            r * angle.sin(),
            z0 + h * (1.0 - angle.cos()) - h * (1.0 - (PI / 8.0).cos()),
        )
    };
    let mut profile: Vec<(f64, f64)> = (0..=8)
        .map(|k| arc(radius, height, 0.0, f64::from(k) / 8.0))
        .collect();
    profile.push((radius - wall, profile[8].1));
    profile.extend(
        (0..8)
            .rev()
            .map(|k| arc(radius - wall, height - wall, wall, f64::from(k) / 8.0)),
    );
    turned(&profile)
}

/// A plate: flat middle, rim raised by `height`.
pub fn plate(radius: f64, height: f64, thickness: f64) -> RawMesh {
    let flat = radius * 0.62;
    turned(&[
        (flat, 0.0),
        (radius * 0.8, height * 0.5),
        (radius, height),
        (radius, height + thickness * 0.6),
        (radius * 0.8, height * 0.5 + thickness),
        (flat, thickness),
    ])
}

/// A table knife along z: handle, then a blade that tapers to an edge and a point.
pub fn knife(length: f64, handle_width: f64, handle_thickness: f64, blade_width: f64) -> RawMesh {
    let handle = length * 0.45;
    let section = |w: f64, t: f64, z: f64| rounded_rectangle(w / 2.0, t / 2.0, t * 0.45, z, 4);
    let blade = 0.0022;
    capped(&[
        section(handle_width * 0.8, handle_thickness * 0.7, 0.0),
        section(handle_width, handle_thickness, 0.006),
        section(handle_width * 0.85, handle_thickness, handle * 0.6),
        section(handle_width, handle_thickness * 0.9, handle),
        section(blade_width, blade, handle + 0.004),
        section(blade_width, blade, length * 0.8),
        section(blade_width * 0.7, blade * 0.9, length * 0.93),
        section(blade_width * 0.15, blade * 0.6, length),
    ])
}

/// A spoon along z: a flat stem and a dished bowl.
pub fn spoon(length: f64, stem_width: f64, thickness: f64, bowl_width: f64) -> RawMesh {
    let bowl_start = length * 0.7;
    let mut rings = vec![
        rounded_rectangle(stem_width * 0.75, thickness / 2.0, thickness * 0.4, 0.0, 4),
        rounded_rectangle(
            stem_width * 0.8,
            thickness / 2.0,
            thickness * 0.4,
            length * 0.08,
            4,
        ),
        rounded_rectangle(
            stem_width * 0.45,
            thickness * 0.6,
            thickness * 0.4,
            bowl_start * 0.7,
            4,
        ),
    ];
    for k in 0..=6 {
        let s = f64::from(k) / 6.0;
        let swell = (PI * (0.12 + 0.8 * s)).sin();
        let half = (bowl_width / 2.0 * swell).max(stem_width * 0.4);
        let sag = -0.18 * bowl_width * (PI * s).sin();
        let mut ring = rounded_rectangle(
            half,
            thickness / 2.0,
            thickness * 0.4,
            bowl_start + (length - bowl_start) * s,
            4,
        );
        for p in &mut ring {
            p[1] += sag;
        }
        rings.push(ring);
    }
    capped(&rings)
}

/// A screwdriver along z: a fluted-size handle, a shaft and a flat tip.
pub fn screwdriver(length: f64, handle_radius: f64, shaft_radius: f64) -> RawMesh {
    let handle = length * 0.42;
    let n = 16;
    let tip = shaft_radius * 0.35;
    capped(&[
        circle(handle_radius * 0.75, 0.0, n),
        circle(handle_radius, handle * 0.12, n),
        circle(handle_radius * 0.92, handle * 0.55, n),
        circle(handle_radius, handle * 0.8, n),
        circle(handle_radius * 0.6, handle, n),
        circle(shaft_radius, handle + 0.001, n),
        circle(shaft_radius, length - 0.012, n),
        ellipse(shaft_radius * 1.15, tip, length - 0.003, n),
        ellipse(shaft_radius * 1.1, tip * 0.7, length, n),
    ])
}

/// A hammer: an oval handle along z and a square head across it.
pub fn hammer(length: f64, handle_width: f64, head_length: f64, head_width: f64) -> RawMesh {
    let grip = |f: f64, z: f64| {
        rounded_rectangle(
            handle_width / 2.0 * f,
            handle_width * 0.36 * f,
            handle_width * 0.3,
            z,
            4,
        )
    };
    let head = |inset: f64, z: f64| {
        rounded_rectangle(
            head_length / 2.0 - inset,
            head_width / 2.0 - inset,
            0.003,
            z,
            4,
        )
    };
    let start = length - head_width;
    capped(&[
        grip(0.9, 0.0),
        grip(1.0, 0.008),
        grip(0.8, length * 0.45),
        grip(0.7, start),
        head(0.003, start + 0.0005),
        head(0.0, start + 0.0035),
        head(0.0, length - 0.003),
        head(0.003, length),
    ])
}

/// A ring (torus) with a round section, lying flat.
pub fn ring(radius: f64, tube_radius: f64) -> RawMesh {
    let rings: Vec<Ring> = (0..AROUND)
        .map(|i| {
            let u = TAU * i as f64 / AROUND as f64;
            (0..12)
                .map(|j| {
                    let v = -TAU * f64::from(j) / 12.0;
                    let r = radius + tube_radius * v.cos();
                    [r * u.cos(), r * u.sin(), tube_radius * (1.0 + v.sin())]
                })
                .collect()
        })
        .collect();
    closed(&rings)
}

/// A hat: a hollow crown with a brim.
pub fn hat(radius: f64, height: f64, brim: f64, wall: f64) -> RawMesh {
    let dome = |r: f64, h: f64, s: f64| {
        let angle = PI / 2.0 * s;
        (
            r * (0.06 + 0.94 * angle.cos().max(0.0).powf(0.6)),
            h * angle.sin(),
        )
    };
    let mut profile: Vec<(f64, f64)> = (0..=8)
        .rev()
        .map(|k| dome(radius - wall, height - wall, f64::from(k) / 8.0))
        .collect();
    profile.extend([(radius + brim, 0.0), (radius + brim, wall), (radius, wall)]);
    profile.extend(
        (1..=8)
            .map(|k| dome(radius, height, f64::from(k) / 8.0))
            .filter(|p| p.1 > 1.5 * wall),
    );
    turned(&profile)
}
