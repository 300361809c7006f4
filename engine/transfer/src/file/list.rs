//! Lists of numbers as Slicer writes them in `.vp` and XML: how many there are, then intensity and values in
//! turn.

use glam::DVec3;

use super::super::{ColourPoint, OpacityPoint};
use super::curve::{Node, straightened};
use super::entry::{MAX_POINTS, broken, opacity_points};
use base::error::Result;

/// Parses a list into rows of `N` numbers: an intensity and its values.
fn rows<const N: usize>(what: &str, text: &str) -> Result<Vec<[f64; N]>> {
    let mut words = text.split_ascii_whitespace();
    let first = words.next().ok_or_else(|| broken(format!("{what} is empty")))?;
    let count: usize =
        first.parse().map_err(|_| broken(format!("{what}: {first:?} is not a number of numbers")))?;
    if count > N * MAX_POINTS {
        return Err(broken(format!("{what}: {count} numbers, at most {} can be used", N * MAX_POINTS)));
    }
    let parse = |(i, word): (usize, &str)| {
        word.parse::<f64>().map_err(|_| broken(format!("{what}: number {} is {word:?}", i + 1)))
    };
    // One more than announced is enough to see that there are too many.
    let numbers: Vec<f64> = words.take(count + 1).enumerate().map(parse).collect::<Result<_>>()?;
    if numbers.len() != count || !count.is_multiple_of(N) || count == 0 {
        let found = if numbers.len() > count { "more".to_owned() } else { numbers.len().to_string() };
        return Err(broken(format!(
            "{what}: {count} numbers announced, {found} found, a multiple of {N} needed"
        )));
    }
    Ok(numbers.chunks_exact(N).map(|row| std::array::from_fn(|i| row[i])).collect())
}

/// Parses a list of opacities into control points.
pub fn opacities(what: &str, text: &str) -> Result<Vec<OpacityPoint>> {
    let nodes = rows::<2>(what, text)?.into_iter().map(|[x, y]| Node::straight(x, y)).collect();
    Ok(opacity_points(&straightened(nodes, false, |a, b, share| a + (b - a) * share)))
}

/// Parses a list of colours into control points.
pub fn colours(what: &str, text: &str) -> Result<Vec<ColourPoint>> {
    let node = |[x, r, g, b]: [f64; 4]| Node::straight(x, DVec3::new(r, g, b));
    let nodes = rows::<4>(what, text)?.into_iter().map(node).collect();
    let points = straightened(nodes, false, |a: DVec3, b, share| a.lerp(b, share));
    Ok(points.into_iter().map(|(intensity, colour)| ColourPoint { intensity, colour }).collect())
}
