// Vectors of three numbers, and affine matrices of three rows of four.
import type { Affine, Vec3 } from '../types.ts';

export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a: Vec3, by: number): Vec3 => [a[0] * by, a[1] * by, a[2] * by];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
];
export const length = (a: Vec3): number => Math.hypot(...a);
export const unit = (a: Vec3): Vec3 => scaled(a, 1 / length(a));

/** Where a matrix takes a place. */
export const moved = (m: Affine, [x, y, z]: Vec3): Vec3 => [0, 4, 8].map(
    (row) => m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3]) as Vec3;

/** A column of the linear part, 0 to 2, or the translation, 3. */
export const column = (m: Affine, k: number): Vec3 => [m[k], m[4 + k], m[8 + k]];

/** The matrix that undoes another. */
export function inverse(m: Affine): Affine {
    const [x, y, z, t] = [0, 1, 2, 3].map((k) => column(m, k));
    const volume = dot(x, cross(y, z));
    return [cross(y, z), cross(z, x), cross(x, y)].flatMap((row) => {
        const scaledRow = scaled(row, 1 / volume);
        return [...scaledRow, -dot(scaledRow, t)];
    }) as Affine;
}
