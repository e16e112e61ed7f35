//! Names beside points, out of each other's way.

/// A rectangle, from its upper left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Area {
    fn overlap(&self, other: &Self) -> f64 {
        let along = |a: f64, a_size: f64, b: f64, b_size: f64| {
            ((a + a_size).min(b + b_size) - a.max(b)).max(0.0)
        };
        along(self.x, self.width, other.x, other.width)
            * along(self.y, self.height, other.y, other.height)
    }

    /// With room around it.
    const fn grown(&self, by: f64) -> Self {
        Self {
            x: self.x - by,
            y: self.y - by,
            width: self.width + 2.0 * by,
            height: self.height + 2.0 * by,
        }
    }

    const fn size(&self) -> f64 {
        self.width * self.height
    }
}

/// Height of a name.
pub(super) const HEIGHT: f64 = 15.0;

/// About how wide a name is drawn, in bold.
pub(super) fn width(text: &str) -> f64 {
    let of = |character: char| match character {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | ' ' => 5.0,
        'f' | 'r' | 't' | '(' | ')' | '-' | '/' | '"' => 6.5,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 13.5,
        'A'..='Z' | '_' => 10.0,
        // Of most alphabets; of those that need more no width is known here.
        _ => 9.0,
    };
    text.chars().map(of).sum()
}

/// Where to write names beside their points: of a few places around each, nearest
/// first, the one that covers least of names written before, of points and of what
/// lies outside. The same input gives the same places.
pub(super) fn place(names: &[(f64, f64, f64)], points: &[(f64, f64)], bounds: Area) -> Vec<Area> {
    let mut placed: Vec<Area> = Vec::new();
    let names_of = names;
    for &(x, y, width) in names {
        let at = |far: f64, across: f64, down: f64| Area {
            x: x + across * far + (across - 1.0) * width / 2.0,
            y: y + down * far + (down - 1.0) * HEIGHT / 2.0,
            width,
            height: HEIGHT,
        };
        let around = [
            (1.0, 0.0),
            (0.7, -1.0),
            (-1.0, 0.0),
            (0.0, -1.0),
            (0.0, 1.0),
            (0.7, 1.0),
            (-0.7, -1.0),
            (-0.7, 1.0),
        ];
        let areas = [12.0, 24.0, 38.0, 54.0]
            .into_iter()
            .flat_map(|far| around.map(|(across, down)| (far, at(far, across, down))));
        let cost = |&(far, area): &(f64, Area)| {
            let roomy = area.grown(3.0);
            let names: f64 = placed.iter().map(|other| roomy.overlap(other)).sum();
            let covered = |&(x, y): &(f64, f64), size: f64| {
                area.overlap(&Area {
                    x: x - size / 2.0,
                    y: y - size / 2.0,
                    width: size,
                    height: size,
                })
            };
            let points: f64 = points.iter().map(|point| covered(point, 8.0)).sum();
            // Points with names are larger, and matter more.
            let named = names_of.iter().map(|&(x, y, _)| covered(&(x, y), 18.0));
            let points = points + 5.0 * named.sum::<f64>();
            let outside = area.size() - area.overlap(&bounds);
            // A name on a name cannot be read; one on a point can.
            far * 0.5 + 20.0 * names + points + 20.0 * outside
        };
        let best = areas.min_by(|a, b| cost(a).total_cmp(&cost(b)));
        placed.push(best.map_or_else(|| at(12.0, 1.0, 0.0), |(_, area)| area));
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Area = Area {
        x: 0.0,
        y: 0.0,
        width: 400.0,
        height: 300.0,
    };

    #[test]
    fn a_name_alone_stands_to_the_right() {
        let [area] = place(&[(100.0, 100.0, 40.0)], &[(100.0, 100.0)], BOUNDS)[..] else {
            panic!("one name");
        };
        assert_eq!((area.x, area.y), (112.0, 92.5));
    }

    #[test]
    fn names_of_points_in_one_place_do_not_cover_each_other() {
        let names = vec![(200.0, 150.0, 60.0); 8];
        let areas = place(&names, &[(200.0, 150.0); 8], BOUNDS);
        for (place, area) in areas.iter().enumerate() {
            for other in &areas[..place] {
                assert_eq!(area.overlap(other), 0.0, "{area:?} {other:?}");
            }
        }
    }

    #[test]
    fn names_stay_within_bounds() {
        for corner in [(0.0, 0.0), (400.0, 0.0), (0.0, 300.0), (400.0, 300.0)] {
            let area = place(&[(corner.0, corner.1, 80.0)], &[corner], BOUNDS)[0];
            assert_eq!(area.overlap(&BOUNDS), area.size(), "{corner:?} {area:?}");
        }
    }
}
