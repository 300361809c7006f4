// What tests of field/ share: fixtures, a writer of what the reader reads, and the formulas of
// docs/design/method.md as they stand there.
import fs from 'node:fs';
import { Tree } from '../field/coder.ts';
import { ROWS, SAMPLES, WHOLE } from '../field/field.ts';
import type { Field } from '../field/field.ts';
import type { Region } from '../field/region.ts';
import { crc32 } from '../field/vgs.ts';
import type { SplatSet } from '../field/vgs.ts';
import type { Atlas, Vec3 } from '../types.ts';

const at = (name: string): URL => new URL(`fixtures/${name}`, import.meta.url);

/** The bytes of a fixture. */
export const bytesOf = (name: string): Uint8Array => new Uint8Array(fs.readFileSync(at(name)));

/** What `vgs rasterize` makes of the splats of a fixture. */
export interface Rasterized {
    size: Vec3;
    /** Numbers of voxels without O, with O, without and so on, x fastest. */
    runs: number[];
    /** V of every so manieth of those with O. */
    every: number;
    values: number[];
    /** O of the same; none: 1. */
    occupancies?: number[];
}

export const rasterized = (name: string): Rasterized =>
    JSON.parse(fs.readFileSync(at(`${name}.json`), 'utf8'));

/** V, O, the object and whether V is known, at voxel (x, y, z) of the box of a field. */
export function voxel(
    field: Field, x: number, y: number, z: number,
): { v: number; o: number; known: boolean; label: number } {
    const { bricks, slots, background, label } = field, p = [x + 1, y + 1, z + 1];
    const within = p.every((v, k) => v >= 0 && v >> 3 < bricks[k]);
    const slot = within ? slots[((p[2] >> 3) * bricks[1] + (p[1] >> 3)) * bricks[0] + (p[0] >> 3)] : -1;
    if (slot < 0) return { v: background, o: 0, known: false, label };
    const row = slot * ROWS + (p[2] & 7) * 8 + (p[1] & 7), i = row * (SAMPLES / ROWS) + (p[0] & 7);
    const known = !field.known || ((field.known[row] >> (p[0] & 7)) & 1) === 1;
    return { v: field.values[i], o: field.occupancies[i] / WHOLE, known,
        label: field.labels ? field.labels[i] : label };
}

/** The number that a half stands for. */
export function number(bits: number): number {
    const exponent = (bits >> 10) & 31, part = (bits & 0x3ff) / 1024;
    return (bits & 0x8000 ? -1 : 1) * (exponent ? (1 + part) * 2 ** (exponent - 15) : part * 2 ** -14);
}

/** V, O and label at texel (x, y, z) of a brick of an atlas, found as the march finds them. */
export function texel(
    atlas: Atlas, [X, Y, Z]: Vec3, x: number, y: number, z: number,
): { v: number; o: number; label: number; alone: boolean } {
    const { bricks, places, dims, texels, labels, middle, scale } = atlas,
        place = places[(Z * bricks[1] + Y) * bricks[0] + X];
    const [px, py, pz] = [place & 1023, (place >> 10) & 1023, place >> 20];
    const i = ((pz * 9 + z) * dims[1] + py * 9 + y) * dims[0] + px * 9 + x;
    const label = labels ? labels[2 * i] : atlas.label, alone = labels ? labels[2 * i + 1] === 255 : true;
    return { v: middle + scale * number(texels[2 * i]), o: number(texels[2 * i + 1]), label, alone };
}

/** Sums over splats at a voxel of their grid, splat by splat, by the formulas. */
export function summed(
    sets: SplatSet[], [x, y, z]: Vec3,
): { weight: number; v: number; o: number; weights: number[] } {
    const [{ kernel, epsilon, occupancyW0, background }] = sets, weights: number[] = [];
    let sum = 0;
    for (const { count, means, roots, opacities, intensities } of sets) {
        let own = 0;
        for (let i = 0; i < count; i++) {
            const [dx, dy, dz] = [x - means[3 * i], y - means[3 * i + 1], z - means[3 * i + 2]];
            const [a, b, c, d, e, f] = roots.subarray(6 * i, 6 * i + 6);
            const u = dx / a, v = (dy - b * u) / c, t = (dz - d * u - e * v) / f, q = u * u + v * v + t * t;
            const w = opacities[i] * profile(kernel, q, Math.max(Math.abs(dx), Math.abs(dy), Math.abs(dz)),
                a * c * f);
            own += w;
            sum += w * (intensities[i] - background);
        }
        weights.push(own);
    }
    const weight = weights.reduce((all, own) => all + own, 0);
    return { weight, v: background + sum / (weight + epsilon), o: weight / (weight + occupancyW0), weights };
}

/** κ(q), with the peak of the density. */
function profile(kernel: SplatSet['kernel'], q: number, away: number, volume: number): number {
    if (kernel === 'compact') return q < 6 ? (1 - q / 6) ** 3 : 0;
    if (kernel === 'gated') {
        return q < 4.794 ** 2 && away <= 10
            ? Math.exp(-q / 2) / (1 + Math.exp((Math.sqrt(q + 1e-6) - 1.794) / 0.75)) : 0;
    }
    return q < 9 ? Math.exp(-q / 2) * (kernel === 'density' ? 1 / ((2 * Math.PI) ** 1.5 * volume) : 1) : 0;
}

/** Steps to a voxel and those beside it, and their weights in the binomial filter. */
const AROUND = [-1, 0, 1].flatMap((z) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((x) => [x, y, z] as Vec3)));
const weightOf = (step: Vec3): number => step.reduce((weight, d) => weight * (d === 0 ? 0.5 : 0.25), 1);

/**
 * What is shown of a region, voxel by voxel as engine/volume/src/edges and beyond.rs have it, on the box
 * that is there. `value` tells V and Σ w of a fit at a voxel of the grid.
 */
export function shown(
    region: Region, value: (fit: number, voxel: Vec3) => { v: number; weight: number },
): { first: Vec3; size: Vec3; at: (...place: Vec3) => { v: number; o: number; number: number | null } } {
    const margin = [7, 3, 3], first = region.first.map((v, k) => v - margin[k]) as Vec3;
    const size = region.size.map((n, k) => (k === 0 ? Math.ceil((n + 6) / 16) * 16 + 8 : n + 6)) as Vec3;
    const [nx, ny, nz] = size, all = Array.from({ length: nx * ny * nz }, (_, i) => i);
    const place = (i: number): Vec3 => [i % nx, Math.floor(i / nx) % ny, Math.floor(i / (nx * ny))];
    const index = ([x, y, z]: Vec3): number => (z * ny + y) * nx + x;
    const moved = (p: Vec3, step: Vec3): Vec3 => p.map((v, k) => v + step[k]) as Vec3;
    const within = (p: Vec3): boolean => p.every((v, k) => v >= 0 && v < size[k]);
    const kinds = all.map((i) => {
        const [x, y, z] = place(i).map((v, k) => v - margin[k]), [a, b, c] = region.size;
        const is = x >= 0 && y >= 0 && z >= 0 && x < a && y < b && z < c;
        return is ? region.kinds[(z * b + y) * a + x] : 0;
    });
    // Depths, between their bounds.
    const bounds = all.map((i) => {
        let squared = 36;
        for (let n = 0; n < 125; n++) {
            const step: Vec3 = [n % 5 - 2, Math.floor(n / 5) % 5 - 2, Math.floor(n / 25) - 2];
            const other = moved(place(i), step), away = step.reduce((sum, d) => sum + d * d, 0);
            const kind = within(other) ? kinds[index(other)] : 0;
            if (away < 9 && (kind > 0) !== (kinds[i] > 0)) squared = Math.min(squared, away);
        }
        const d = Math.sqrt(squared), least = Math.max(d - 1, 0.02);
        const side = kinds[i] > 0 ? [least, d, d - 0.5] : [-d, -least, 0.5 - d];
        return side.map((depth) => Math.round((Math.min(Math.max(depth, -2), 2) + 2) * 512));
    });
    let depths = bounds.map(([, , begin]) => begin);
    const filtered = (from: number[], stride: number): number[] => {
        const along = (values: number[], k: number): number[] => all.map((i) => {
            const [a, b] = [-stride, stride].map((by) => {
                const p = place(i);
                p[k] = Math.min(Math.max(p[k] + by, 0), size[k] - 1);
                return values[index(p)];
            });
            return (a + 2 * values[i] + b + 2) >> 2;
        });
        return along(along(along(from, 1), 2), 0);
    };
    for (const stride of [2, 1, 2, 1, 2, 1, 2, 1]) {
        const once = filtered(depths, stride);
        const sharp = all.map((i) => (i % nx < 4 || i % nx >= nx - 4 ? 0 : 2 * depths[i] - once[i]));
        const twice = filtered(sharp, stride);
        depths = all.map((i) => Math.min(Math.max(twice[i], bounds[i][0]), bounds[i][1]));
    }
    // V of the splats, and beyond.
    const values = new Float32Array(all.length).fill(NaN), known = new Uint8Array(all.length);
    const fits = [...new Set(region.objects.map(({ fit }) => fit))].sort((a, b) => a - b);
    const fitAt = (p: Vec3): number | null => {
        const kind = within(p) ? kinds[index(p)] : 0;
        return kind > 0 ? region.objects[kind - 1].fit : null;
    };
    for (const fit of fits) for (const i of all) {
        const p = place(i), own = fitAt(p) === fit;
        const rim = kinds[i] === 0 && AROUND.some((step) => fitAt(moved(p, step)) === fit);
        if (!own && !(rim && Number.isNaN(values[i]))) continue;
        const { v, weight } = value(fit, moved(p, first));
        if (weight > 1e-37) [values[i], known[i]] = [v, kinds[i]];
    }
    // Splats say what V is in the rim, and what is farther out continues it.
    for (let layer = 0; layer < 2; layer++) {
        const found: { i: number; kind: number; v: number; own: number }[] = [];
        for (const i of all.filter((i) => known[i] === 0)) {
            const sums = new Map<number, [number, number]>();
            for (const step of AROUND) {
                const p = moved(place(i), step), j = index(p);
                if (!within(p) || known[j] === 0) continue;
                const [weight, sum] = sums.get(known[j]) ?? [0, 0];
                sums.set(known[j], [weight + weightOf(step), Math.fround(sum + weightOf(step) * values[j])]);
            }
            const [best] = [...sums].sort((a, b) => b[1][0] - a[1][0] || a[0] - b[0]);
            if (!best) continue;
            const [kind, [weight, sum]] = best;
            found.push({ i, kind, v: Math.fround(sum / weight), own: values[i] });
        }
        const darker = new Map<number, number>();
        for (const { kind, v, own } of found) {
            darker.set(kind, (darker.get(kind) ?? 0) + (own < v ? 1 : own > v ? -1 : 0));
        }
        for (const { i, kind, v, own } of found) {
            const rule = darker.get(kind)! >= 0 ? Math.min : Math.max;
            [values[i], known[i]] = [Number.isNaN(own) ? v : rule(v, own), kind];
        }
    }
    const at = (...place: Vec3) => {
        const i = index(place), kind = kinds[i] || known[i];
        const inside = (depths[i] - 1024) / 512, ramp = inside > 0 ? 0.5 : 1;
        const o = Math.min(Math.max(Math.round(127.5 + 127.5 * inside / ramp), 0), 255) / 255;
        const number = kind > 0 ? region.objects[kind - 1].number : null;
        return { v: values[i], o: kind > 0 ? o : 0, number };
    };
    return { first, size, at };
}

/** A file with another header: what `change` makes of it, with the checksum that it then has. */
export function withHeader(bytes: Uint8Array, change: (header: any) => void): Uint8Array {
    const view = new DataView(bytes.buffer, bytes.byteOffset), end = 20 + view.getUint32(12, true);
    const header = JSON.parse(new TextDecoder().decode(bytes.subarray(20, end)));
    change(header);
    const text = new TextEncoder().encode(JSON.stringify(header)),
        made = new Uint8Array(20 + text.length + bytes.length - end);
    made.set(bytes.subarray(0, 12));
    made.set(text, 20);
    made.set(bytes.subarray(end), 20 + text.length);
    const out = new DataView(made.buffer);
    out.setUint32(12, text.length, true);
    out.setUint32(16, crc32(text), true);
    return made;
}

/**
 * Writes what `Decoder` reads (engine/splat/src/vgs/coder.rs), with whole numbers of any length for `low`.
 */
export class Encoder {
    private low = 0n;
    private range = 0xffffffff;
    private bytes = 0;

    number(tree: Tree, number: number): void {
        let node = 1;
        for (let k = tree.bits - 1; k >= 0; k--) {
            const bit = (number >> k) & 1, p = tree.zero[node], n = tree.seen[node];
            const bound = (this.range >>> 15) * Math.min(Math.max(p >> 1, 32), 32768 - 32);
            if (bit) this.low += BigInt(bound);
            this.range = bit ? this.range - bound : bound;
            tree.zero[node] = p + Math.trunc((((bit ? 0 : 65535) - p) * 2) / (2 * n + 3));
            tree.seen[node] = Math.min(n + 1, 250);
            this.shift();
            node = node * 2 + bit;
        }
    }

    even(number: number, count: number): void {
        this.range = Math.floor(this.range / count);
        this.low += BigInt(this.range) * BigInt(number);
        this.shift();
    }

    finish(): Uint8Array {
        const text = (this.low >> 0n).toString(16).padStart(2 * (this.bytes + 4), '0');
        return Uint8Array.from(text.match(/../g) ?? [], (pair) => parseInt(pair, 16));
    }

    private shift(): void {
        while (this.range < 1 << 24) {
            this.range = (this.range << 8) >>> 0;
            this.low <<= 8n;
            this.bytes++;
        }
    }
}
