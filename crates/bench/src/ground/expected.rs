//! The expected hit rate of an error file, computed from its parameters and the masks, without running the oracle.

use spf_core::query::ImagePoint;
use spf_core::tags::Tagged;
use spf_flight::dataset::Visible;
use spf_oracle::{ErrorFile, SIZE_SENT};

use super::source::SimExample;
use super::{Outline, Truth};

/// Probability that an oracle with these errors hits the target of an example: it notices the target, does not confuse
/// it with another object, and its point falls on the mask. `None` without a target.
#[must_use]
pub fn hit(errors: &ErrorFile, example: &SimExample, truth: &Truth, outline: &Outline) -> Option<f64> {
    let (Truth::Target(_), Some(target), Some(mask)) = (truth, &example.row.target, outline.mask()) else { return None };
    let of = |visible: &&Visible| visible.id == target.id && visible.opening == target.opening;
    let visible = example.row.visible.iter().find(of)?;
    let (width, height) = (f64::from(mask.width), f64::from(mask.height));
    let all = width * height;
    let high = f64::from(target.bounds[3] - target.bounds[1]) / height;
    let in_view = (high >= 0.008 && visible.in_frame >= 0.25) || visible.pixels as f64 >= 0.1 * all;
    if !in_view {
        return Some(0.0);
    }
    let deviation = (errors.point.width_share * width).max(errors.point.size_share * (visible.pixels as f64).sqrt());
    let inside = mass(&mask.inside, mask.width as usize, outline.middle(), deviation);
    let mistaken = errors.which.confused * another_is_seen(errors, example, visible, all);
    Some(seen(errors, visible, all) * (1.0 - mistaken) * inside)
}

/// Probability that an object is noticed (docs/explanation/oracle.md, "Seen").
fn seen(errors: &ErrorFile, visible: &Visible, all: f64) -> f64 {
    let sent = f64::from(SIZE_SENT.0) * f64::from(SIZE_SENT.1);
    let side = (visible.pixels as f64 * sent / all).sqrt() * f64::from(visible.light);
    let seen = &errors.seen;
    let width = (seen.sure_px - seen.half_px) / libm::log(19.0);
    let chance = if width > 0.0 {
        1.0 / (1.0 + libm::exp((seen.half_px - side) / width))
    } else {
        f64::from(u8::from(side >= seen.half_px))
    };
    (1.0 - seen.missed) * chance
}

/// Probability that another object is noticed with which the target could be confused.
fn another_is_seen(errors: &ErrorFile, example: &SimExample, target: &Visible, all: f64) -> f64 {
    let tags = |visible: &Visible| example.tags.iter().find(|tags| tags.id == visible.id && tags.opening == visible.opening);
    let Some(own) = tags(target) else { return 0.0 };
    let like = |other: &Tagged| {
        (other.kind == own.kind && other.opening == own.opening)
            || other.names.iter().any(|name| own.names.contains(name))
            || (other.colour.is_some() && other.colour == own.colour)
    };
    let others = example.row.visible.iter().filter(|other| other.id != target.id && tags(other).is_some_and(like));
    1.0 - others.map(|other| 1.0 - seen(errors, other, all)).product::<f64>()
}

/// Fraction of an isotropic normal distribution that falls on a mask. Points outside the image are moved to its edge,
/// so its outermost pixels include everything beyond them.
fn mass(inside: &[bool], width: usize, middle: ImagePoint, deviation: f64) -> f64 {
    let height = inside.len() / width.max(1);
    if deviation <= 0.0 {
        let (x, y) = ((middle.u * width as f64) as usize, (middle.v * height as f64) as usize);
        return f64::from(u8::from(inside.get(y * width + x).copied().unwrap_or(false)));
    }
    let fractions = |count: usize, centre: f64| -> Vec<f64> {
        let below = |edge: f64| 0.5 * libm::erfc((centre - edge) / (deviation * std::f64::consts::SQRT_2));
        let upper = |i: usize| if i + 1 == count { 1.0 } else { below((i + 1) as f64) };
        let lower = |i: usize| if i == 0 { 0.0 } else { below(i as f64) };
        (0..count).map(|i| upper(i) - lower(i)).collect()
    };
    let (across, down) = (fractions(width, middle.u * width as f64), fractions(height, middle.v * height as f64));
    let row = |y: usize| -> f64 { (0..width).filter(|x| inside[y * width + x]).map(|x| across[x]).sum() };
    (0..height).filter(|y| down[*y] > 1e-12).map(|y| down[y] * row(y)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mass_of_a_square_by_hand() {
        // A square of 20 pixels around the middle of 100 × 100, deviation 10: erf(1/√2)² = 0.6827² = 0.4661.
        let inside: Vec<bool> = (0..10_000).map(|i| (40..60).contains(&(i % 100)) && (40..60).contains(&(i / 100))).collect();
        let middle = ImagePoint { u: 0.5, v: 0.5 };
        assert!((mass(&inside, 100, middle, 10.0) - 0.4661).abs() < 1e-3);
        assert_eq!(mass(&inside, 100, middle, 0.0), 1.0);
        // Everything is inside, whatever lies beyond the edge.
        assert!((mass(&vec![true; 10_000], 100, ImagePoint { u: 0.01, v: 0.99 }, 30.0) - 1.0).abs() < 1e-9);
    }
}
