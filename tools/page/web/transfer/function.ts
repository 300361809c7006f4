// Transfer functions: control points, and the lines between them (engine/transfer/src/function.rs).
import type { TransferFunction, Vec3 } from '../types.ts';

/** The greatest opacity per mm that differs from 1, whose extinction would be infinite. */
const MAX_OPACITY = 0.9995;

/** The extinction, 1/mm, of an opacity per mm. */
export function extinctionOf(opacity: number): number {
    return -Math.log1p(-Math.min(opacity, MAX_OPACITY));
}

/**
 * What lies at an intensity on the straight lines through sorted points: the numbers behind the intensity of each. Two
 * points at one intensity are a step, and the later one holds from there on; `below`: the earlier one still does.
 */
export function interpolated(points: readonly (readonly number[])[], v: number, below = false): number[] {
    let next = 0;
    while (next < points.length && (below ? points[next][0] < v : points[next][0] <= v)) next++;
    const low = points[Math.max(next - 1, 0)];
    const high = points[next];
    if (next === 0 || high === undefined) return low.slice(1);
    const share = (v - low[0]) / (high[0] - low[0]);
    return low.slice(1).map((value, i) => value * (1 - share) + high[i + 1] * share);
}

/** Colour, and opacity per mm, at an intensity. */
export function at(tf: TransferFunction, v: number): [Vec3, number] {
    return [interpolated(tf.colours, v) as Vec3, interpolated(tf.opacities, v)[0]];
}

/**
 * The least and the greatest intensity between which something shows, infinite where it goes on beyond the last point;
 * null if all is transparent.
 */
export function visible(tf: TransferFunction): [number, number] | null {
    const first = tf.opacities.findIndex((point) => point[1] > 0);
    if (first < 0) return null;
    const last = tf.opacities.findLastIndex((point) => point[1] > 0);
    const high = tf.opacities[last + 1];
    return [first === 0 ? -Infinity : tf.opacities[first - 1][0], high === undefined ? Infinity : high[0]];
}

/** The intensities of the first and the last point of colour or opacity. */
export function extent(tf: TransferFunction): [number, number] {
    const { colours, opacities } = tf;
    return [
        Math.min(colours[0][0], opacities[0][0]),
        Math.max(colours[colours.length - 1][0], opacities[opacities.length - 1][0]),
    ];
}

/** True if the opacity depends on the magnitude of the gradient. */
export function dependsOnGradient(tf: TransferFunction): boolean {
    return tf.gradientOpacities.some((point) => point[1] !== 1);
}

/** The same function with all intensities greater by `by`. */
export function shifted(tf: TransferFunction, by: number): TransferFunction {
    return moved(tf, (v) => v + by, 1);
}

/** The same function over other intensities: the line that takes `from` to `to` is applied to all points. */
export function stretched(
    tf: TransferFunction, from: [number, number], to: [number, number],
): TransferFunction {
    const factor = (to[1] - to[0]) / (from[1] - from[0]);
    return moved(tf, (v) => to[0] + (v - from[0]) * factor, factor);
}

function moved(tf: TransferFunction, place: (v: number) => number, factor: number): TransferFunction {
    return {
        ...tf,
        colours: tf.colours.map(([v, ...colour]) => [place(v), ...colour]),
        opacities: tf.opacities.map(([v, opacity]) => [place(v), opacity]),
        // Gradients are differences of intensities: a shift does not change them.
        gradientOpacities: tf.gradientOpacities.map(([v, share]) => [v * factor, share]),
    };
}
