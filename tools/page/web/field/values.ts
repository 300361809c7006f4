// The intensities of a region's voxels and of its rim, in place of splats (engine/splat/src/voxels.rs and
// vgs/values.rs).
import type { Vec3 } from '../types.ts';
import { Decoder } from './coder.ts';
import type { Region } from './region.ts';
import { INSIDE, OUTSIDE, RIM, VoxelReader } from './voxel.ts';

/** V of the voxels of the objects of a fit, and of those beside them. */
export interface Values {
    fit: number;
    /** First voxel of a box, and its size. */
    first: Vec3;
    size: Vec3;
    /** V of each voxel of the box, x fastest; NaN where it is not known. */
    values: Float32Array;
}

/** V of a voxel of the grid; NaN where it is not known. */
export function valueAt(
    { first, size: [nx, ny, nz], values }: Values, x: number, y: number, z: number,
): number {
    const i = x - first[0], j = y - first[1], k = z - first[2];
    return i >= 0 && j >= 0 && k >= 0 && i < nx && j < ny && k < nz ? values[(k * ny + j) * nx + i] : NaN;
}

/** Slices of a slab. */
const SLAB = 32;
/** Greatest size of a code. */
const LARGEST_CODE = 2 ** 26;
/** The bound of the rim, in that of the region. */
const RIM_BOUNDS = 2;

/** Where the voxels of the box are, with a border of one voxel around it. */
function sitesOf(region: Region, fit: number, first: Vec3, size: Vec3): { sites: Uint8Array; steps: Vec3 } {
    const [nx, ny, nz] = size, [w, h, d] = region.size, steps: Vec3 = [1, nx + 2, (nx + 2) * (ny + 2)];
    const sites = new Uint8Array(steps[2] * (nz + 2));
    const index = (x: number, y: number, z: number): number => z * steps[2] + y * steps[1] + x;
    const own = [false, ...region.objects.map((object) => object.fit === fit)];
    const [ox, oy, oz] = region.first.map((v, k) => v - first[k] + 1);
    for (let z = 0, i = 0; z < d; z++) {
        for (let y = 0; y < h; y++) {
            const row = index(ox, y + oy, z + oz);
            for (let x = 0; x < w; x++, i++) if (own[region.kinds[i]]) sites[row + x] = INSIDE;
        }
    }
    // One axis after the other, so that corners are reached.
    for (const step of steps) {
        const before = sites.slice();
        for (let z = 1; z <= nz; z++) {
            for (let y = 1; y <= ny; y++) {
                for (let x = 1, at = index(1, y, z); x <= nx; x++, at++) {
                    if (before[at] === OUTSIDE && (before[at - step] || before[at + step])) sites[at] = RIM;
                }
            }
        }
    }
    return { sites, steps };
}

/**
 * Reads V of a region's objects of a fit, in a grid of `grid` voxels, from the bytes of the slabs; null if the
 * bytes are none. A code of 1 stands for `step`, and is off by at most `bound`.
 */
export function readValues(
    slabs: Uint8Array[], region: Region, grid: Vec3, fit: number, step: number, bound: number,
): Values | null {
    const first = region.first.map((v) => Math.max(v - 1, 0)) as Vec3;
    const size = region.first.map((v, k) => Math.min(v + region.size[k] + 1, grid[k]) - first[k]) as Vec3;
    if (region.kinds.length === 0) size.fill(0);
    const [nx, ny, nz] = size, values = new Float32Array(nx * ny * nz).fill(NaN);
    if (slabs.length !== Math.ceil(nz / SLAB)) return null;
    const { sites, steps } = sitesOf(region, fit, first, size);
    for (let k = 0; k < slabs.length; k++) {
        const input = new Decoder(slabs[k]);
        const reader = new VoxelReader(input, size, [RIM_BOUNDS * bound, bound], steps);
        let any = false;
        for (let z = k * SLAB; z < Math.min((k + 1) * SLAB, nz); z++) {
            reader.next();
            for (let y = 0, to = z * nx * ny; y < ny; y++) {
                let at = (z + 1) * steps[2] + (y + 1) * steps[1] + 1;
                for (let x = 0; x < nx; x++, at++, to++) {
                    if (sites[at] === OUTSIDE) continue;
                    any = true;
                    const code = reader.read(x, y, sites, at);
                    if (!(Math.abs(code) <= LARGEST_CODE) || input.isBeyond) return null;
                    values[to] = code * step;
                }
            }
        }
        if (!any && slabs[k].length > 0) return null;
    }
    return { fit, first, size, values };
}
