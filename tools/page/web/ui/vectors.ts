// What the page needs of vectors besides render/vectors.ts.
import { sub } from '../render/vectors.ts';
import type { Vec3 } from '../types.ts';

/** a + by · b */
export const along = (a: Vec3, b: Vec3, by = 1): Vec3 => [
    a[0] + by * b[0],
    a[1] + by * b[1],
    a[2] + by * b[2],
];
export const distance = (a: Vec3, b: Vec3): number => Math.hypot(...sub(a, b));
/** The place that lies so far along each of three vectors. */
export const sum = (vectors: Vec3[], shares: readonly number[]): Vec3 =>
    vectors.reduce((total, vector, k) => along(total, vector, shares[k]), [0, 0, 0] as Vec3);
export const clamp = (value: number, low: number, high: number): number =>
    Math.min(Math.max(value, low), high);

/** The eight corners of a box; bit k of a corner's number says whether it is at the upper end of axis k. */
export function corners(low: Vec3, high: Vec3): Vec3[] {
    return Array.from({ length: 8 }, (_, i) => low.map((l, k) => ((i >> k) & 1 ? high[k] : l)) as Vec3);
}
