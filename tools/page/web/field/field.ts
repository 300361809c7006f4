// A decoded field: V and O at the voxels of a box, kept in bricks of 8³ as far as splats reach.
import type { Affine, Vec3 } from '../types.ts';

/** Voxels in a brick. */
export const SAMPLES = 512;
/** Rows of voxels in a brick. */
export const ROWS = 64;
/** The O of a voxel is kept in parts of this. */
export const WHOLE = 65535;
/** Greatest number of bricks that hold something: 67 million voxels. */
export const MOST_BRICKS = 1 << 17;

/**
 * Voxel (x, y, z) of the box lies in the brick of ((x, y, z) + 1) >> 3, at the place of its lowest three bits
 * there, x fastest.
 */
export interface Field {
    /** Voxels of the box, with an empty border of one voxel. */
    size: Vec3;
    /** Bricks along x, y, z. */
    bricks: Vec3;
    /** Slot of each brick, x fastest; -1: nothing is there. */
    slots: Int32Array;
    /** V of the voxels of each slot; that of the background where it is not known. */
    values: Float32Array;
    /** O of the voxels of each slot, in parts of WHOLE. */
    occupancies: Uint16Array;
    /**
     * Where V is known, and where O is not 0: a byte for each row of voxels along x of each slot, 64 a slot.
     * If `known` is null, V is known wherever it counts, also beyond the faces of the grid.
     */
    known: Uint8Array | null;
    there: Uint8Array;
    /** Number of the object of the voxels of each slot; null if all have `label`. */
    labels: Uint8Array | null;
    label: number;
    /** First and last voxel of the box from which on V is that of the face of the grid. */
    faces: [Vec3, Vec3];
    worldFromVoxel: Affine;
    /** Mean edge of a voxel of the CT's grid, mm. */
    edge: number;
    /** Least and greatest V. */
    range: [number, number];
    /** V where nothing is known. */
    background: number;
    /** Number of splats; 0 if it is not known. */
    splats: number;
}

/** Told again and again what is being done, and the part of it that is done, 0 to 1. */
export type Progress = (stage: 'reading' | 'decoding' | 'arranging', part: number) => void;

/** The affine of a box that begins at a voxel of another one. */
export function from(m: readonly number[], [x, y, z]: Vec3): Affine {
    return m.map((v, i) => (i % 4 < 3 ? v : v + m[i - 3] * x + m[i - 2] * y + m[i - 1] * z)) as Affine;
}

/** Edges of a voxel along x, y, z, mm. */
export function spacingOf(m: readonly number[]): Vec3 {
    return [0, 1, 2].map((k) => Math.sqrt(m[k] ** 2 + m[k + 4] ** 2 + m[k + 8] ** 2)) as Vec3;
}

/** The number of bricks along each axis that hold the voxels of a box and one on each side. */
export function bricksOf(size: Vec3): Vec3 {
    return size.map((n) => (n + 8) >> 3) as Vec3;
}
