// The region that splats were fitted to: the voxels that are shown, and the object of each
// (engine/splat/src/region, whose voxels.rs has the bytes).
import type { Vec3 } from '../types.ts';
import { Decoder, Tree } from './coder.ts';
import { Refusal } from './refusal.ts';

export interface RegionObject {
    number: number;
    /** The fit whose splats tell V: splats reach beyond the region that they were fitted to. */
    fit: number;
}

export interface Region {
    /** First voxel of the box around all voxels, and its size. */
    first: Vec3;
    size: Vec3;
    /** Kind of each voxel of the box, x fastest: 0 is none, k the object k - 1. */
    kinds: Uint8Array;
    objects: RegionObject[];
}

const MOST_KINDS = 255;
/** Most voxels of a byte, and fewest bytes that may stand for a box of any size. */
const MOST_A_BYTE = 65536;
const LEAST_BYTES = 1024;
/** The neighbours of a voxel that come before it. */
const NEIGHBOURS = [
    [-1, 0, 0], [0, -1, 0], [0, 0, -1], [-2, 0, 0], [-3, 0, 0], [-1, -1, 0], [1, -1, 0], [-2, -1, 0],
    [2, -1, 0], [0, -2, 0], [1, 0, -1], [-1, 0, -1], [0, 1, -1], [0, -1, -1],
];
/** Neighbours whose kinds are tried before a kind is spelt out. */
const TRIED = 3;
/** Voxels of no kind before and behind the box, along x, y, z. */
const BEFORE = [3, 2, 1], BEHIND = [2, 1, 0];

/** Models of the bits of a region, and what they read. */
class Kinds {
    readonly input: Decoder;
    readonly even = new Tree(7);
    private readonly first = new Tree(2 ** NEIGHBOURS.length - 1);
    private readonly next = new Tree(4 * TRIED - 1);
    private readonly spelt: Tree;
    private readonly count: number;
    private readonly tried = new Uint8Array(TRIED);

    constructor(bytes: Uint8Array, count: number) {
        this.input = new Decoder(bytes);
        this.spelt = new Tree(count);
        this.count = count;
    }

    /**
     * Reads a kind, one of those of some neighbours or another; one that is too great is none. `pattern` is
     * -1 for bricks.
     */
    read(pattern: number, likely: ArrayLike<number>): number {
        const { input, tried, count } = this;
        let n = 0;
        const isTried = (kind: number): boolean => tried.subarray(0, n).includes(kind);
        for (let i = 0; i < TRIED; i++) {
            const kind = likely[i];
            if (n > 0 && isTried(kind)) continue;
            // Where only one kind is left it needs no bit.
            if (n === count) return kind;
            const bit = n === 0 && pattern >= 0 ? input.bit(this.first, pattern)
                : input.bit(this.next, n * 4 + (kind === 0 ? 1 : 0) + (pattern >= 0 ? 2 : 0));
            if (bit) return kind;
            tried[n++] = kind;
        }
        if (n === count) for (let kind = 0; kind <= count; kind++) if (!isTried(kind)) return kind;
        return input.number(this.spelt);
    }
}

/** Reads the kinds of the voxels of a box; null if the bytes are none. */
function readKinds(bytes: Uint8Array, size: Vec3, count: number): Uint8Array | null {
    const kinds = new Kinds(bytes, count), { input } = kinds, bricks = size.map((n) => Math.ceil(n / 8));
    const even = new Int16Array(bricks[0] * bricks[1] * bricks[2]), likely = new Int16Array(TRIED);
    const brickSteps = [1, bricks[0], bricks[0] * bricks[1]];
    for (let i = 0; i < even.length; i++) {
        const place = [i % bricks[0], Math.floor(i / bricks[0]) % bricks[1], Math.floor(i / brickSteps[2])];
        let pattern = 0;
        for (let k = 0; k < 3; k++) {
            const kind = place[k] > 0 ? even[i - brickSteps[k]] : 0;
            pattern = pattern * 2 + (kind >= 0 ? 1 : 0);
            likely[k] = Math.max(kind, 0);
        }
        even[i] = input.bit(kinds.even, pattern) ? kinds.read(-1, likely) : -1;
        if (even[i] > count || input.isBeyond) return null;
    }
    const [nx, ny, nz] = size, [px, py, pz] = size.map((n, k) => BEFORE[k] + n + BEHIND[k]);
    const steps = NEIGHBOURS.map(([x, y, z]) => x + px * (y + py * z));
    const found = new Uint8Array(px * py * pz), out = new Uint8Array(nx * ny * nz);
    const around = new Uint8Array(NEIGHBOURS.length);
    for (let z = 0, to = 0; z < nz; z++) {
        for (let y = 0; y < ny; y++, to += nx) {
            const row = ((z + BEFORE[2]) * py + y + BEFORE[1]) * px + BEFORE[0];
            const line = ((z >> 3) * bricks[1] + (y >> 3)) * bricks[0];
            for (let x = 0; x < nx; x++) {
                const kind = even[line + (x >> 3)], at = row + x;
                if (kind >= 0) {
                    found[at] = kind;
                    continue;
                }
                const before = around[0] = found[at - 1];
                let pattern = before === 0 ? 1 : 0;
                for (let i = 1; i < steps.length; i++) {
                    around[i] = found[at + steps[i]];
                    pattern = (pattern << 1) | (around[i] === before ? 1 : 0);
                }
                const read = kinds.read(pattern, around);
                if (read > count) return null;
                found[at] = read;
            }
            out.set(found.subarray(row, row + nx), to);
            if (input.isBeyond) return null;
        }
    }
    return out;
}

/** Whether every object has voxels, and every face of the box, too. */
function isTight({ size: [nx, ny, nz], kinds, objects }: Region): boolean {
    const found = new Uint8Array(objects.length + 1), faces = [false, false, false, false, false, false];
    for (let z = 0, i = 0; z < nz; z++) {
        for (let y = 0; y < ny; y++, i += nx) {
            const row = kinds.subarray(i, i + nx);
            if (row.every((kind) => kind === 0)) continue;
            for (const kind of row) found[kind] = 1;
            [row[0] > 0, row[nx - 1] > 0, y === 0, y + 1 === ny, z === 0, z + 1 === nz]
                .forEach((there, k) => (faces[k] ||= there));
        }
    }
    return kinds.length === 0 || (found.subarray(1).every((there) => there) && faces.every((there) => there));
}

/** Reads a region of a grid of `size` voxels; null if the bytes are none. */
export function readRegion(bytes: Uint8Array, size: Vec3): Region | null {
    let at = 0;
    /** A number of seven bits a byte, the least first; NaN if there is none. */
    const number = (): number => {
        for (let shift = 0, value = 0; shift < 35 && at < bytes.length; shift += 7) {
            const byte = bytes[at++];
            value += (byte & 127) * 2 ** shift;
            if (byte < 128) return value < 2 ** 32 ? value : NaN;
        }
        return NaN;
    };
    const three = (): Vec3 => [number(), number(), number()];
    const first = three(), extent = three(), count = number();
    if (!first.every((v, k) => v + extent[k] <= size[k]) || !(count <= MOST_KINDS)) return null;
    const objects = Array.from({ length: count }, () => ({ number: number(), fit: number() }));
    const sound = objects.every(({ number, fit }, i) =>
        number <= 255 && fit <= 255 && (i === 0 || number > objects[i - 1].number));
    const voxels = extent[0] * extent[1] * extent[2], rest = bytes.subarray(at);
    const possible = voxels <= Math.max(LEAST_BYTES, rest.length) * MOST_A_BYTE;
    if (!sound || !possible || (voxels === 0) !== (count === 0)) return null;
    const kinds = readKinds(rest, extent, count);
    const region = kinds && { first, size: extent, kinds, objects };
    return region && isTight(region) ? region : null;
}

/**
 * The voxels of all regions. A voxel of several belongs to the object of fewest voxels, as a part lies in a
 * whole.
 */
export function joined(regions: Region[]): Region {
    if (regions.length === 1) return regions[0];
    const there = regions.filter(({ kinds }) => kinds.length > 0);
    const ends = [0, 1, 2].map((k) => [
        Math.min(...there.map(({ first }) => first[k])),
        Math.max(...there.map(({ first, size }) => first[k] + size[k])),
    ]);
    if (there.length === 0) return regions[0];
    const all = there.flatMap(({ kinds, objects }) => {
        const counts = new Uint32Array(objects.length + 1);
        for (const kind of kinds) counts[kind]++;
        return objects.map((object, i) => ({ object, count: counts[i + 1] }));
    });
    if (all.length > MOST_KINDS) throw new Refusal(`The scene has more than ${MOST_KINDS} objects.`);
    const inOrder = (a: RegionObject, b: RegionObject): number => a.number - b.number || a.fit - b.fit;
    const objects = all.map(({ object }) => object).sort(inOrder);
    const kindOf = new Map(objects.map((object, i) => [object, i + 1]));
    /** By kind, which one of several gets a voxel: the least. */
    const rank = new Uint8Array(objects.length + 1).fill(MOST_KINDS);
    all.sort((a, b) => a.count - b.count || inOrder(a.object, b.object))
        .forEach(({ object }, i) => (rank[kindOf.get(object)!] = i));
    const first = ends.map(([low]) => low) as Vec3, size = ends.map(([low, high]) => high - low) as Vec3;
    const kinds = new Uint8Array(size[0] * size[1] * size[2]);
    for (const region of there) {
        const own = region.objects.map((object) => kindOf.get(object)!), [nx, ny] = region.size;
        const [x0, y0, z0] = region.first.map((v, k) => v - first[k]);
        for (let from = 0; from < region.kinds.length; from += nx) {
            const row = from / nx, y = y0 + row % ny, z = z0 + Math.floor(row / ny);
            const to = (z * size[1] + y) * size[0] + x0;
            for (let x = 0; x < nx; x++) {
                const kind = region.kinds[from + x] && own[region.kinds[from + x] - 1];
                if (kind > 0 && rank[kind] < rank[kinds[to + x]]) kinds[to + x] = kind;
            }
        }
    }
    return { first, size, kinds, objects };
}
