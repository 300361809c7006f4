// A transfer function as it is edited: one list of points with intensity, opacity and colour, as in the
// desktop viewer (tools/view/src/model/transfer.rs and panels/editor). Heights are the square root of the
// opacity per mm: a hundredth is as easily grasped as a half.
import { at, interpolated } from '../transfer/function.ts';
import type { TransferFunction, Vec3 } from '../types.ts';
import { clamp } from './vectors.ts';

export interface Point {
    intensity: number;
    /** Per mm. */
    opacity: number;
    /** Display-referred, 0 to 1. */
    colour: Vec3;
}

/** Least distance of points, as a share of the full range. */
const APART = 1e-4;

export const heightOf = (opacity: number): number => Math.sqrt(Math.max(opacity, 0));
export const opacityOf = (height: number): number => clamp(height, 0, 1) ** 2;

/** Joins points of colour and of opacity into one list; the function between them stays. */
export function pointsOf(tf: TransferFunction): Point[] {
    const places = [...new Set([...tf.colours, ...tf.opacities].map((p) => p[0]))].sort((a, b) => a - b);
    return places.flatMap((intensity) => {
        const step = [tf.colours, tf.opacities].some(
            (points) => points.filter((p) => p[0] === intensity).length > 1,
        );
        const point = (below: boolean): Point => ({
            intensity,
            opacity: interpolated(tf.opacities, intensity, below)[0],
            colour: interpolated(tf.colours, intensity, below) as Vec3,
        });
        // The first point of a step has the values to the left of it.
        return step ? [point(true), point(false)] : [point(false)];
    });
}

/** The function of points; the rest of it is that of another one. */
export function functionOf(points: Point[], rest: TransferFunction): TransferFunction {
    return {
        ...rest,
        colours: points.map((p) => [p.intensity, ...p.colour]),
        opacities: points.map((p) => [p.intensity, p.opacity]),
    };
}

/** The intensities that can be shown and that points can be moved to: those of the data and of the points. */
export function fullRange(points: Point[], data: [number, number]): [number, number] {
    const margin = 0.02 * Math.max(data[1] - data[0], 1e-3);
    return [
        Math.min(points[0].intensity, data[0] - margin),
        Math.max(points[points.length - 1].intensity, data[1] + margin),
    ];
}

/**
 * Adds a point with the colour that the function has there. Returns its index; -1: another point is there.
 */
export function add(
    points: Point[],
    tf: TransferFunction,
    intensity: number,
    opacity: number,
    full: [number, number],
): number {
    const place = clamp(intensity, ...full);
    const gap = APART * (full[1] - full[0]);
    if (points.some((p) => Math.abs(p.intensity - place) < gap)) return -1;
    const index = points.filter((p) => p.intensity < place).length;
    points.splice(index, 0, { intensity: place, opacity: clamp(opacity, 0, 1), colour: at(tf, place)[0] });
    return index;
}

/** Moves a point as far as its neighbours and the range allow. */
export function move(
    points: Point[],
    index: number,
    intensity: number,
    opacity: number,
    full: [number, number],
): void {
    const gap = APART * (full[1] - full[0]);
    const low = index > 0 ? points[index - 1].intensity + gap : full[0];
    const high = index + 1 < points.length ? points[index + 1].intensity - gap : full[1];
    // Neighbours nearer than two gaps, as those of a step, leave no room.
    const place = low <= high ? clamp(intensity, low, high) : points[index].intensity;
    points[index] = { ...points[index], intensity: place, opacity: clamp(opacity, 0, 1) };
}

/**
 * Where a point halfway between one and the next would be; before the last one, or in the middle of what is
 * seen.
 */
export function beside(points: Point[], index: number, seen: [number, number]): number {
    const middle = (i: number) => (points[i].intensity + points[i + 1].intensity) / 2;
    if (index >= 0 && index + 1 < points.length) return middle(index);
    return index > 0 ? middle(index - 1) : (seen[0] + seen[1]) / 2;
}

/** A round number, 1, 2 or 5 times a power of ten, that is not below a value. */
export function roundUp(value: number): number {
    const power = 10 ** Math.floor(Math.log10(value));
    return ([1, 2, 5].find((n) => n * power >= value * (1 - 1e-9)) ?? 10) * power;
}

/** A round number that is not above a value. */
export function roundDown(value: number): number {
    const power = 10 ** Math.floor(Math.log10(value));
    return ([5, 2].find((n) => n * power <= value * (1 + 1e-9)) ?? 1) * power;
}

/** Multiples of a round number within a range; at most `count` steps. */
export function ticks([low, high]: [number, number], count: number): number[] {
    const step = roundUp((high - low) / Math.max(count, 1));
    const first = Math.ceil(low / step);
    const places = Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
    return places.map((v) => Number(v.toPrecision(12)));
}
