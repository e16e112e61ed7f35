//! What probes show, in f64, from its definition.
//!
//! A ray is followed to each of the six planes of the room by itself, and what it meets
//! is the one among those points that is on the room. Nothing is shared with the kernels,
//! which compare times.

use glam::DVec3;

use super::Probe;
use crate::truth::smooth;

/// Where a ray from a point along a way leaves the box from `-half` to `half`; from the
/// nearest point of the box for a point that is outside of it, and that point if the way
/// has no length.
#[must_use]
pub fn box_exit(point: DVec3, way: DVec3, half: DVec3) -> DVec3 {
    let point = point.clamp(-half, half);
    // Of all points ahead where the ray meets a plane, the one that is least outside of the
    // others' sides: the exit is not outside at all. A ray along a side may leave by it in
    // so long a time that what it moves until then is no number: then the first.
    let mut best: Option<([f64; 2], DVec3)> = None;
    for axis in 0..3 {
        for side in [-half[axis], half[axis]] {
            // Ahead is the side to which the ray goes.
            if (side < 0.0) != way[axis].is_sign_negative() && half[axis] > 0.0 {
                continue;
            }
            let time = (side - point[axis]) / way[axis];
            if !time.is_finite() {
                continue;
            }
            let mut met = point + way * time;
            met[axis] = side;
            let beyond = (met.abs() - half) / half.max(DVec3::splat(f64::MIN_POSITIVE));
            let rank = [beyond.max_element().max(0.0), time];
            if best.is_none_or(|(least, _)| rank < least) {
                best = Some((rank, met));
            }
        }
    }
    best.map_or(point, |(_, met)| met.clamp(-half, half))
}

/// How much a probe counts at a point of the world.
#[must_use]
pub fn influence(probe: &Probe, point: DVec3) -> f64 {
    let within = (probe.influence - probe.room.place(point).abs()) / f64::from(probe.falloff);
    within.to_array().into_iter().map(smooth).product()
}

/// The share of each probe at a point, and that of the world.
#[must_use]
pub fn shares(probes: &[Probe], point: DVec3) -> (Vec<f64>, f64) {
    let mut rest = 1.0;
    let shares = probes.iter().map(|probe| {
        let share = rest * influence(probe, point);
        rest -= share;
        share
    });
    (shares.collect(), rest)
}

/// The direction in which a probe's map shows what a ray from a point of the world along
/// a unit way meets.
#[must_use]
pub fn projected(probe: &Probe, point: DVec3, way: DVec3) -> DVec3 {
    let room = &probe.room;
    let turned = room.turn.inverse() * way;
    let exit = box_exit(room.place(point), turned, room.half);
    room.turn * (exit - room.place(probe.position)).normalize_or(turned)
}

/// Light that reaches a point from a unit way: `map` is that of each probe by its number,
/// `world` that of the world.
pub fn light(
    probes: &[Probe],
    point: DVec3,
    way: DVec3,
    map: impl Fn(usize, DVec3) -> DVec3,
    world: impl Fn(DVec3) -> DVec3,
) -> DVec3 {
    let (shares, rest) = shares(probes, point);
    let lit = probes.iter().zip(shares).enumerate();
    let sum: DVec3 = lit
        .filter(|(_, (_, share))| *share > 0.0)
        .map(|(number, (probe, share))| map(number, projected(probe, point, way)) * share)
        .sum();
    sum + world(way) * rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_leave_where_they_are_seen_to() {
        let half = DVec3::new(2.0, 1.0, 3.0);
        for (point, way, exit) in [
            (DVec3::ZERO, DVec3::X, DVec3::new(2.0, 0.0, 0.0)),
            (DVec3::ZERO, DVec3::NEG_Y, DVec3::new(0.0, -1.0, 0.0)),
            (
                DVec3::new(1.0, 0.0, 0.0),
                DVec3::ONE,
                DVec3::new(2.0, 1.0, 1.0),
            ),
            (
                DVec3::new(0.0, 0.0, 2.0),
                DVec3::new(0.0, 0.5, -1.0),
                DVec3::new(0.0, 1.0, 0.0),
            ),
            // From outside, as from the nearest point of the box.
            (
                DVec3::new(9.0, 0.5, 0.0),
                DVec3::X,
                DVec3::new(2.0, 0.5, 0.0),
            ),
            (
                DVec3::new(9.0, 0.5, 0.0),
                DVec3::NEG_X,
                DVec3::new(-2.0, 0.5, 0.0),
            ),
            // Nowhere to go.
            (
                DVec3::new(1.0, 5.0, 1.0),
                DVec3::ZERO,
                DVec3::new(1.0, 1.0, 1.0),
            ),
        ] {
            let got = box_exit(point, way, half);
            assert!(
                got.distance(exit) < 1e-12,
                "{point} {way}: {got}, not {exit}"
            );
        }
        // Flat along y: what rises leaves at once, what does not goes to a side.
        let flat = DVec3::new(2.0, 0.0, 3.0);
        let point = DVec3::new(0.5, 0.0, 0.5);
        assert_eq!(box_exit(point, DVec3::new(1.0, 0.1, 0.0), flat), point);
        assert_eq!(box_exit(point, DVec3::X, flat), DVec3::new(2.0, 0.0, 0.5));
    }
}
