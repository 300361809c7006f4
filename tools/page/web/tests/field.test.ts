// From the bytes of a page to the atlas that it shows.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { makeAtlas } from '../field/atlas.ts';
import { Decoder, Places, Tree } from '../field/coder.ts';
import { decodeSplats } from '../field/decode.ts';
import type { Field } from '../field/field.ts';
import { Refusal } from '../field/refusal.ts';
import { readRegion } from '../field/region.ts';
import type { Region } from '../field/region.ts';
import { valueAt } from '../field/values.ts';
import { crc32, readVgs } from '../field/vgs.ts';
import type { Kernel, SplatSet } from '../field/vgs.ts';
import { readVoxels } from '../field/voxels.ts';
import { decode } from '../field/worker.ts';
import type { Atlas, Part, Vec3 } from '../types.ts';
import { differences } from './differences.ts';
import { Encoder, bytesOf, rasterized, shown, summed, texel, voxel, withHeader } from './field.ts';
import { nifti, writeWhole } from './nifti.ts';
import { program, vgs } from './program.ts';

const still = (): void => {};
const read = (name: string): SplatSet => readVgs(bytesOf(`${name}.vgs`));
const decoded = (...sets: SplatSet[]): Field =>
    decodeSplats(sets.map((set) => ({ set, numbers: [] })), still);
const part = (data: Uint8Array, kind: Part['kind'] = 'vgs', numbers: [number, number][] = []) =>
    ({ kind, bytes: data.length, numbers, data });

/** Calls `each` with every voxel of a box, x fastest. */
function everyVoxel([nx, ny, nz]: Vec3, each: (x: number, y: number, z: number) => void): void {
    for (let z = 0; z < nz; z++) for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++) each(x, y, z);
}

/** The voxel of the box of a field at a voxel of its grid. */
function ofGrid(field: Field, x: number, y: number, z: number): ReturnType<typeof voxel> {
    const [low] = field.faces;
    return voxel(field, x + low[0], y + low[1], z + low[2]);
}

/** A generator of numbers from 0 to 1 (mulberry32). */
function random(seed: number): () => number {
    return () => {
        seed = (seed + 0x6d2b79f5) | 0;
        let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
        t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
        return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
    };
}

describe('the coder', () => {
    it('reads what was written', () => {
        const next = random(3), encoder = new Encoder(), written: [number, number][] = [];
        const [trees, models] = [0, 1].map(() => [new Tree(1000), new Tree(0), new Tree(65535)]);
        for (let i = 0; i < 3000; i++) {
            const k = Math.floor(next() * 4), count = 1 + Math.floor(next() ** 4 * 65535);
            const number = k < 3 ? Math.floor(next() ** 3 * [1001, 1, 65536][k]) : Math.floor(next() * count);
            if (k < 3) encoder.number(trees[k], number);
            else encoder.even(number, count);
            written.push([k < 3 ? k : 3 + count, number]);
        }
        const bytes = encoder.finish(), decoder = new Decoder(bytes);
        for (const [k, number] of written) {
            assert.equal(k < 3 ? decoder.number(models[k]) : decoder.even(k - 3), number);
        }
        assert.equal(decoder.isBeyond, false);
        for (let i = 0; i < 50; i++) assert.ok(decoder.even(60000) < 60000);
        assert.equal(decoder.isBeyond, true);
    });

    it('finds places with indices of 21 bits', () => {
        const code = (place: number[]): bigint => {
            let made = 0n;
            for (let bit = 20; bit >= 0; bit--) {
                for (const index of place) made = (made << 1n) | BigInt((index >> bit) & 1);
            }
            return made;
        };
        const wanted = [
            [0, 0, 0], [0, 0, 1], [5, 1, 2], [5, 1, 2], [1023, 77, 1024], [40000, 3, 65535],
            [2 ** 20, 9, 2 ** 21 - 1], [2 ** 21 - 1, 2 ** 21 - 1, 2 ** 21 - 1],
        ];
        const encoder = new Encoder(), bits = new Tree(63);
        const below = Array.from({ length: 64 }, () => new Tree(3));
        let last = 0n;
        for (const place of [...wanted].sort((a, b) => (code(a) < code(b) ? -1 : 1))) {
            const gap = code(place) - last, count = gap === 0n ? 0 : gap.toString(2).length;
            last = code(place);
            encoder.number(bits, count);
            let rest = Math.max(count - 1, 0);
            if (rest > 2) encoder.number(below[count], Number((gap >> BigInt((rest -= 2))) & 3n));
            while (rest > 0) {
                const piece = Math.min(rest, 16);
                rest -= piece;
                encoder.even(Number((gap >> BigInt(rest)) & BigInt(2 ** piece - 1)), 2 ** piece);
            }
        }
        encoder.number(bits, 1);
        const input = new Decoder(encoder.finish()), places = new Places();
        const found = wanted.map(() => {
            assert.ok(places.read(input) >= 0);
            return [0, 1, 2].map((axis) => places.index(axis));
        });
        assert.deepEqual(found, [...wanted].sort((a, b) => (code(a) < code(b) ? -1 : 1)));
        assert.equal(places.read(input), -1, 'behind the last place there is none');
    });
});

describe('splats on a grid', () => {
    for (const [name, file] of [['binary'], ['labels'], ['soft'], ['labels', 'region']]) {
        it(`have the V and O of vgs rasterize: ${file ?? name}`, () => {
            const set = read(file ?? name), field = decoded(set), least = set.form === 'grid' ? 1e-5 : 0.5;
            const { size, runs, every, values, occupancies } = rasterized(name);
            const inside = new Uint8Array(size[0] * size[1] * size[2]);
            let at = 0, index = 0, k = 0, compared = 0;
            runs.forEach((count, i) => inside.fill(i % 2, at, (at += count)));
            everyVoxel(size, (x, y, z) => {
                const { v, o } = ofGrid(field, x, y, z), i = index++;
                assert.equal(o > least, inside[i] === 1, `O at ${x} ${y} ${z}`);
                if (!inside[i] || k++ % every > 0) return;
                assert.ok(Math.abs(v - values[compared]) < 0.03, `V is ${v}, not ${values[compared]}`);
                if (occupancies) assert.ok(Math.abs(o - occupancies[compared]) < 4e-5);
                compared++;
            });
            assert.equal(compared, values.length);
        });
    }

    for (const kernel of ['compact', 'gaussian', 'density', 'gated'] as Kernel[]) {
        it(`sum up as the formulas say: ${kernel}`, () => {
            const set: SplatSet = { ...read('soft'), kernel }, field = decoded(set);
            let reached = 0;
            everyVoxel(set.grid!.size, (x, y, z) => {
                const found = ofGrid(field, x, y, z), { weight, v, o } = summed([set], [x, y, z]);
                assert.equal(found.known, weight > 1e-37, `${x} ${y} ${z}`);
                if (!found.known) return;
                reached++;
                assert.ok(Math.abs(found.v - v) < 0.02, `${found.v} is not ${v} at ${x} ${y} ${z}`);
                assert.ok(Math.abs(found.o - o) < 5e-5);
            });
            assert.ok(reached > 1000);
        });
    }

    it('lie where they are if their space is not that of the grid', () => {
        const m = [1.2, 0.3, 0, -18, -0.3, 1.2, 0.1, -12, 0, 0, -1.6, 20], size: Vec3 = [30, 30, 30];
        const set = read('soft'), field = decoded({ ...set, grid: { size, affine: m } });
        let compared = 0;
        everyVoxel(size, (x, y, z) => {
            // The space of the fixture: voxels of 1.5 mm from -17.25 mm on.
            const mm = [0, 4, 8].map((r) => m[r] * x + m[r + 1] * y + m[r + 2] * z + m[r + 3]);
            const place = mm.map((v) => (v + 17.25) / 1.5) as Vec3;
            const found = ofGrid(field, x, y, z), { weight, v } = summed([set], place);
            if (weight < 1e-6) return;
            compared++;
            assert.ok(Math.abs(found.v - v) < 0.05, `${found.v} is not ${v}`);
        });
        assert.ok(compared > 1000);
    });

    it('belong to the object that has most of the weight', () => {
        const set = { ...read('labels'), form: 'grid' as const }, of = (label: number): SplatSet => {
            const rows = Array.from(set.labels!.keys()).filter((i) => set.labels![i] === label);
            const taken = <T extends Float64Array | Float32Array>(from: T, n: number): T =>
                from.filter((_, i) => rows.includes(Math.floor(i / n))) as T;
            return {
                ...set, count: rows.length, means: taken(set.means, 3), roots: taken(set.roots, 6),
                opacities: taken(set.opacities, 1), intensities: taken(set.intensities, 1), labels: null,
            };
        };
        const field = decodeSplats([{ set, numbers: [[3, 12], [7, 5]] }], still), sets = [of(3), of(7)];
        const counts = new Map<number, number>();
        everyVoxel(set.grid!.size, (x, y, z) => {
            const { label, o } = ofGrid(field, x, y, z), [three, seven] = summed(sets, [x, y, z]).weights;
            if (three + seven === 0 || Math.abs(three - seven) < 1e-6 * three) return;
            assert.equal(label, three > seven ? 12 : 5);
            if (o > 0.5) counts.set(label, (counts.get(label) ?? 0) + 1);
        });
        assert.ok(counts.get(12)! > 30 && counts.get(5)! > 30);
        const { histograms } = makeAtlas(field, still);
        for (const [label, count] of counts) {
            assert.equal(histograms.get(label)!.reduce((sum, n) => sum + n, 0), count);
        }
    });

    it('of several sets are one field', () => {
        const one = read('soft'), background = one.background - 40;
        const other = { ...one, background, intensities: one.intensities.map((c) => c + 30) };
        const field = decoded(one, other), mean = one.background - 20;
        assert.ok(Math.abs(field.background - mean) < 1e-3);
        everyVoxel(one.grid!.size, (x, y, z) => {
            const found = ofGrid(field, x, y, z);
            const sums = summed([{ ...one, background: mean }, other], [x, y, z]);
            if (!found.known) return;
            assert.ok(Math.abs(found.v - sums.v) < 0.02 && Math.abs(found.o - sums.o) < 5e-5);
        });
    });

    it('that do not add up to one field are refused', () => {
        const one = read('binary'), grid = { ...one.grid!, size: [24, 24, 25] as Vec3 };
        for (const [other, word] of [
            [{ ...one, kernel: 'gaussian' }, /kernel/],
            [{ ...one, epsilon: 0.5 }, /ε/], [{ ...one, occupancyW0: 0.5 }, /w₀/],
            [{ ...one, grid }, /different grids/], [{ ...one, unit: 'luminance' }, /luminances/],
            [{ ...one, form: 'grid' }, /soft/],
            [{ ...one, form: 'field' }, /between the voxels/], [{ ...one, grid: null }, /between the voxels/],
        ] as [SplatSet, RegExp][]) {
            const told = (error: unknown): boolean => error instanceof Refusal && word.test(error.message);
            assert.throws(() => decoded(one, other), told);
        }
    });
});

describe('a region', () => {
    /** Compares a field with what is shown of a region. */
    const check = (field: Field, region: Region, sets: SplatSet[]): void => {
        const wanted = shown(region, (fit, voxel) => summed([sets[fit]], voxel)), { first, size } = wanted;
        let soft = 0, beyond = 0;
        everyVoxel(size, (x, y, z) => {
            const { v, o, number } = wanted.at(x, y, z), [a, b, c] = first;
            const found = ofGrid(field, x + a, y + b, z + c), what = `${x} ${y} ${z}`;
            assert.ok(Math.abs(found.o - o) < 1e-6, `O is ${found.o} and not ${o} at ${what}`);
            if (number === null) return;
            assert.ok(Math.abs(found.v - v) < 0.02, `V is ${found.v} and not ${v} at ${what}`);
            assert.equal(found.label, number, what);
            soft += o > 0 && o < 1 ? 1 : 0;
            beyond += o > 0 && o < 0.5 ? 1 : 0;
        });
        assert.ok(soft > 100 && beyond > 50);
    };

    it('has smooth edges, and V of its own beyond', () => {
        const set = read('region');
        check(decoded(set), set.region!, [set]);
    });

    it('of several files has V of the splats of each, and what lies in both is of the smaller object', () => {
        const set = read('region'), whole = set.region!;
        const half = whole.kinds.map((kind, i) => (kind === 2 && i % whole.size[0] < 5 ? 1 : 0));
        const part: Region = { ...whole, kinds: half, objects: [{ number: 0, fit: 0 }] };
        const intensities = set.intensities.map((c) => c + 200);
        const other = { ...set, labels: null, region: part, intensities };
        const numbers: [number, number][][] = [[[3, 1], [7, 2]], [[0, 3]]];
        const field = decodeSplats([set, other].map((set, i) => ({ set, numbers: numbers[i] })), still);
        const kinds = whole.kinds.map((kind, i) => (half[i] ? 3 : kind));
        const objects = [1, 2, 3].map((number) => ({ number, fit: number === 3 ? 1 : 0 }));
        check(field, { ...whole, kinds, objects }, [set, other]);
        assert.deepEqual([...makeAtlas(field, still).histograms.keys()].sort(), [1, 2, 3]);
    });

    it('of a file of version 1 is where the occupancy is above one half, but for exceptions', () => {
        // The other was made of the one by vgs convert.
        const [first, second] = ['labels', 'region'].map((name) => decoded(read(name)));
        assert.deepEqual(first, second);
        const file = new URL('../../../../engine/splat/src/vgs/first-version.vgs', import.meta.url);
        const { histograms } = makeAtlas(decoded(readVgs(new Uint8Array(readFileSync(file)))), still);
        const counts = [...histograms.values()].map((bins) => bins.reduce((sum, n) => sum + n, 0));
        assert.equal(counts.reduce((sum, n) => sum + n, 0), 1374);
    });

    it('is read or refused, whatever its bytes are', () => {
        const file = bytesOf('region.vgs'), begin = 20 + new DataView(file.buffer).getUint32(12, true);
        const { size } = read('region').grid!;
        const { bytes: length } = JSON.parse(new TextDecoder().decode(file.subarray(20, begin))).region;
        const bytes = file.subarray(begin, begin + length), next = random(7);
        assert.deepEqual(readRegion(bytes, size), read('region').region);
        for (let end = 0; end < length - 5; end++) {
            assert.equal(readRegion(bytes.subarray(0, end), size), null);
        }
        let refused = 0;
        for (let i = 0; i < 2000; i++) {
            const changed = bytes.slice();
            for (let k = 0; k < 3; k++) changed[Math.floor(next() * length)] = next() * 256;
            const found = readRegion(changed, size);
            if (!found) refused++;
            else assert.ok(found.first.every((v, k) => v + found.size[k] <= size[k]));
            assert.ok(!found || found.kinds.every((kind) => kind <= found.objects.length));
        }
        assert.ok(refused > 100 && refused < 2000, `${refused}`);
        // A box of 2^96 voxels.
        const most = 2 ** 32 - 1, largest = [255, 255, 255, 255, 15];
        const claim = [0, 0, 0, ...largest, ...largest, ...largest, 1, 7, 0, ...Array(64).fill(0)];
        assert.equal(readRegion(Uint8Array.from(claim), [most, most, most]), null);
    });
});

describe('coded voxels', { skip: program ? false : 'VGS_PROGRAM names no program' }, () => {
    let scratch: string, ct: string, whole: string, mask: string;
    before(() => {
        scratch = mkdtempSync(join(tmpdir(), 'vgs-coded-'));
        [ct, whole, mask] = ['ct', 'whole', 'mask'].map((name) => join(scratch, `${name}.nii.gz`));
        vgs('phantom', '-o', ct, '--mask', mask, '--size', '20,24,60', '--seed', '2', '-q', '-f');
        writeWhole(ct, nifti(ct), whole);
    });
    after(() => rmSync(scratch, { recursive: true }));

    /** The bytes of the file of a region. */
    const coded = (volume: string, mask: string, bound: number, ...flags: string[]): Uint8Array => {
        const file = join(scratch, 'coded.vgs');
        vgs('convert', volume, '--roi', mask, '-o', file, '--bound', `${bound}`, '-q', '-f', ...flags);
        return new Uint8Array(readFileSync(file));
    };

    it('have the V of vgs rasterize, within the bound', () => {
        for (const [volume, bound] of [[whole, 0], [whole, 5], [whole, 30], [ct, 5], [ct, 0.01]] as const) {
            const set = readVgs(coded(volume, mask, bound)), wanted = nifti(ct), [{ values }] = set.voxels;
            assert.deepEqual([set.count, set.voxels.length, set.voxels[0].fit], [0, 1, 0]);
            const { worst, wrong } = differences(join(scratch, 'coded.vgs'), volume, scratch)!;
            // The program takes V through 16 bits, which hold all multiples of a step if these are not too many.
            assert.ok(worst <= (bound === 0.01 ? 0.05 : 1e-3) && wrong === 0, `${worst} and ${wrong} at ${bound}`);
            const { size, first, kinds } = set.region!, [nx, ny] = set.grid!.size;
            let rim = values.reduce((count, v) => count + (Number.isNaN(v) ? 0 : 1), 0), index = 0;
            everyVoxel(size, (i, j, k) => {
                if (!kinds[index++]) return;
                rim--;
                const [x, y, z] = [i + first[0], j + first[1], k + first[2]];
                const exact = wanted[(z * ny + y) * nx + x], v = valueAt(set.voxels[0], x, y, z);
                const most = bound + (volume === whole ? 0.5 : 0) + 1e-3;
                assert.ok(Math.abs(v - exact) <= most, `${v} for ${exact} at ${bound}`);
            });
            assert.ok(rim > 1000, `V of ${rim} voxels beside the region`);
        }
    });

    it('are shown as splats are, with what is beyond and the objects of labels', () => {
        const labels = join(scratch, 'labels.nii.gz');
        const parts = nifti(mask).map((v, i) => (v > 0.5 ? (i % 20 < 9 ? 4 : 9) : 0));
        writeWhole(mask, parts, labels);
        const set = readVgs(coded(ct, labels, 8, '--roi-label', 'all')), field = decoded(set), [nx, ny] = set.grid!.size;
        const { at, first, size } = shown(set.region!, (_, [x, y, z]) => {
            const v = valueAt(set.voxels[0], x, y, z);
            return { v, weight: Number.isNaN(v) ? 0 : 1 };
        });
        assert.deepEqual(set.region!.objects.map(({ number }) => number), [4, 9]);
        everyVoxel(size, (x, y, z) => {
            const wanted = at(x, y, z), found = ofGrid(field, x + first[0], y + first[1], z + first[2]);
            assert.ok(Math.abs(found.o - wanted.o) < 1e-6, `O is ${found.o} and not ${wanted.o}`);
            if (wanted.number === null) return;
            assert.equal(found.v, wanted.v);
            assert.equal(found.label, wanted.number);
        });
        everyVoxel(set.grid!.size, (x, y, z) => {
            const { label, o } = ofGrid(field, x, y, z), part = parts[(z * ny + y) * nx + x];
            if (part > 0) assert.ok(label === part && o > 0.5);
        });
    });

    it('are one scene with splats, whose field it has', () => {
        const [one, other] = [coded(ct, mask, 8), coded(whole, mask, 30)].map(readVgs);
        const splats: SplatSet = {
            ...read('region'), grid: one.grid, region: one.region, labels: null, kernel: 'gaussian',
        };
        const parts = [one, splats].map((set, i) => ({ set, numbers: [[0, i + 1]] as [number, number][] }));
        const field = decodeSplats(parts, still), alone = decoded(one), { first, size, kinds } = one.region!;
        // The first of equals gets the voxels.
        let index = 0;
        everyVoxel(size, (i, j, k) => {
            if (!kinds[index++]) return;
            const place = [i + first[0], j + first[1], k + first[2]] as const;
            const found = ofGrid(field, ...place);
            assert.deepEqual([found.v, found.label], [ofGrid(alone, ...place).v, 1]);
        });
        assert.equal(field.background, splats.background);
        const both = { ...splats, voxels: other.voxels };
        for (const [sets, word] of [[[one, both], /joined itself/], [[splats, one, read('binary')], /different/]] as const) {
            assert.throws(() => decoded(...sets), (e) => e instanceof Refusal && word.test(e.message));
        }
    });

    it('are read or refused, whatever their bytes are', () => {
        const bytes = coded(whole, mask, 5), next = random(11), set = readVgs(bytes);
        const begin = 20 + new DataView(bytes.buffer).getUint32(12, true);
        const header = JSON.parse(new TextDecoder().decode(bytes.subarray(20, begin)));
        const slabs = begin + header.region.bytes, [{ bytes: length }, second] = header.voxels[0].slabs;
        /** Reads, and returns false if the file is refused. */
        const isRead = (data: Uint8Array): boolean => {
            try {
                return readVgs(data).voxels[0].values.length === set.voxels[0].values.length;
            } catch (error) {
                assert.ok(error instanceof Refusal, `${(error as Error).stack}`);
                return false;
            }
        };
        assert.ok(isRead(bytes) && second.bytes > 0);
        for (let at = begin; at < bytes.length; at += 9) {
            const changed = bytes.slice();
            changed[at] ^= 1 << (at % 8);
            assert.ok(!isRead(changed) && !isRead(bytes.subarray(0, at)), `byte ${at}`);
        }
        /** The file with other bytes in its first slab. */
        const withSlab = (slab: Uint8Array): Uint8Array => {
            const rest = bytes.subarray(slabs + length), made = new Uint8Array(slabs + slab.length + rest.length);
            made.set(bytes.subarray(0, slabs));
            made.set(slab, slabs);
            made.set(rest, slabs + slab.length);
            return withHeader(made, (h) =>
                Object.assign(h.voxels[0].slabs[0], { bytes: slab.length, crc32: crc32(slab) }));
        };
        const slab = bytes.subarray(slabs, slabs + length);
        assert.deepEqual(withSlab(slab), withHeader(bytes, () => {}));
        for (let end = 0; end < length - 5; end += 40) assert.ok(!isRead(withSlab(slab.subarray(0, end))));
        for (let i = 0; i < 60; i++) {
            const changed = slab.slice();
            for (let k = 0; k < 3; k++) changed[Math.floor(next() ** 2 * length)] = next() * 256;
            const file = withSlab(changed), found = isRead(file);
            if (!found || i % 12 > 0) continue;
            // The program reads the same, as it shows when it writes what it has read.
            const [from, to] = ['changed', 'again'].map((name) => join(scratch, `${name}.vgs`));
            writeFileSync(from, file);
            vgs('convert', from, '-o', to, '-f', '-q');
            assert.deepEqual(readVgs(new Uint8Array(readFileSync(to))).voxels, readVgs(file).voxels);
        }
        const lies: ((coded: any, header: any) => void)[] = [
            (c) => (c.fit = 256), (c) => (c.fit = 3), (c) => (c.step = 0), (c) => (c.step = 2),
            (c) => (c.step = null), (c) => (c.bound = 2 ** 24), (c) => (c.bound = -1), (c) => (c.whole = 1),
            (c) => (c.slabs = []), (c) => c.slabs.pop(), (c) => (c.slabs = null), (c) => (c.more = 1),
            (c) => (c.slabs[0].crc32 = 1), (c) => c.slabs[0].bytes--, (c) => (c.slabs[0].bytes = 2 ** 60),
            (c, h) => h.voxels.push(c), (_, h) => delete h.region, (_, h) => (h.form = 'grid'),
            (_, h) => (h.voxels = null), (_, h) => (h.voxels = []), (_, h) => (h.grid.size = [9, 9, 9]),
            (_, h) => h.layers.push({ count: 9, bytes: 90, crc32: 1 }),
        ];
        for (const lie of lies) assert.ok(!isRead(withHeader(bytes, (h) => lie(h.voxels[0], h))), `${lie}`);
        assert.ok(isRead(withHeader(bytes, (h) => Object.assign(h.voxels[0], { whole: false, step: 0.5 }))));
    });
});

describe('an atlas', () => {
    for (const name of ['binary', 'region', 'soft']) {
        it(`has V, O and labels of its field, and intervals of all that is read: ${name}`, () => {
            const field = decoded(read(name)), atlas = makeAtlas(field, still);
            checkAtlas(atlas, field);
        });
    }

    it('of nothing is empty', () => {
        const set = read('binary'), far = { ...set, means: set.means.map((v) => v + 1e4) };
        const atlas = makeAtlas(decoded(far), still);
        assert.ok(atlas.texels.every((bits, i) => i % 2 === 0 || bits === 0));
        assert.ok(atlas.leaps.intervals.every((v, i) => v === (i % 2 ? -Infinity : Infinity)));
        assert.equal(atlas.histograms.size, 0);
    });

    it('holds V beyond the faces of the grid, and nothing is there', () => {
        const set = read('soft'), field = decoded({ ...set, grid: { ...set.grid!, size: [12, 11, 12] } });
        const atlas = makeAtlas(field, still), [low, high] = field.faces;
        let held = 0;
        everyTexel(atlas, (brick, at, [x, y, z]) => {
            const place = [x, y, z].map((v, k) => v - offset(atlas, field)[k]) as Vec3;
            const inside = place.map((v, k) => Math.min(Math.max(v, low[k]), high[k])) as Vec3;
            // A sample where something is reads no voxel farther than the first one beyond.
            const beyond = Math.max(...inside.map((v, k) => Math.abs(v - place[k])));
            if (beyond !== 1) return;
            const { v, o } = texel(atlas, brick, ...at), face = voxel(field, ...inside);
            assert.equal(o, 0);
            if (face.o === 0) return;
            held++;
            assert.ok(Math.abs(v - face.v) <= 0.26, `${v} is not ${face.v}`);
        });
        assert.ok(held > 20, `${held}`);
    });

    it('holds V that are far apart or near together', () => {
        for (const factor of [1e-6, 1, 1e7]) {
            const set = read('soft'), intensities = set.intensities.map((c) => c * factor);
            const field = decoded({ ...set, background: set.background * factor, intensities });
            const atlas = makeAtlas(field, still), span = field.range[1] - field.range[0];
            const away = offset(atlas, field);
            everyTexel(atlas, (brick, at, place) => {
                const found = texel(atlas, brick, ...at);
                const there = voxel(field, ...(place.map((v, k) => v - away[k]) as Vec3));
                if (there.o > 0) assert.ok(Math.abs(found.v - there.v) < span / 2000);
            });
        }
    });
});

/** Voxels from the box of a field to that of its atlas. */
function offset(atlas: Atlas, field: Field): Vec3 {
    // The fixtures have axes along those of the world.
    const [m, n] = [field.worldFromVoxel, atlas.worldFromVoxel];
    return [0, 1, 2].map((k) => Math.round((m[4 * k + 3] - n[4 * k + 3]) / m[5 * k])) as Vec3;
}

/**
 * Calls `each` with every texel of every brick that is there: brick, place in it, voxel of the box of the
 * atlas.
 */
function everyTexel({ bricks, places }: Atlas, each: (brick: Vec3, at: Vec3, voxel: Vec3) => void): void {
    everyVoxel(bricks, (X, Y, Z) => {
        if (places[(Z * bricks[1] + Y) * bricks[0] + X] === 0) return;
        everyVoxel([9, 9, 9], (x, y, z) => {
            each([X, Y, Z], [x, y, z], [X * 8 + x - 1, Y * 8 + y - 1, Z * 8 + z - 1]);
        });
    });
}

function checkAtlas(atlas: Atlas, field: Field): void {
    const [a, b, c] = offset(atlas, field);
    const at = (x: number, y: number, z: number) => voxel(field, x - a, y - b, z - c);
    let there = 0, alone = 0, seen = 0;
    everyTexel(atlas, (brick, place, [x, y, z]) => {
        const found = texel(atlas, brick, ...place), wanted = at(x, y, z);
        assert.ok(Math.abs(found.o - wanted.o) < 3e-4);
        if (wanted.o === 0) return;
        there++;
        assert.equal(found.label, wanted.label);
        assert.ok(Math.abs(found.v - wanted.v) <= 0.26, `${found.v} is not ${wanted.v}`);
        // V counts at all corners of the cell, and `alone` says what labels there are.
        const [cx, cy, cz] = place.map((v) => Math.min(v, 7));
        everyVoxel([2, 2, 2], (i, j, k) => {
            const corner = texel(atlas, brick, cx + i, cy + j, cz + k);
            const voxel = at(x - place[0] + cx + i, y - place[1] + cy + j, z - place[2] + cz + k);
            if (voxel.known) assert.ok(Math.abs(corner.v - voxel.v) <= 0.51);
            const told = place.every((v) => v < 8) && found.alone && voxel.o > 0;
            if (told) assert.equal(voxel.label, found.label);
        });
        alone += found.alone ? 1 : 0;
    });
    // All that is there is in some brick, and the border of the box is empty.
    everyVoxel(atlas.size, (x, y, z) => {
        const { o } = at(x, y, z), brick = [x, y, z].map((v) => (v + 1) >> 3) as Vec3;
        if (o === 0) return;
        seen++;
        assert.ok([x, y, z].every((v, k) => v > 0 && v < atlas.size[k] - 1));
        assert.ok(atlas.places[(brick[2] * atlas.bricks[1] + brick[1]) * atlas.bricks[0] + brick[0]] > 0);
    });
    assert.ok(there >= seen && seen > 200 && alone > there / 2);
    const { shift, bricks, intervals } = atlas.leaps;
    everyVoxel(bricks, (X, Y, Z) => {
        const [x, y, z] = [X << shift[0], Y << shift[1], Z << shift[2]];
        const i = 2 * ((Z * bricks[1] + Y) * bricks[0] + X);
        let any = false, least = Infinity, greatest = -Infinity;
        everyVoxel(shift.map((s) => (1 << s) + 3) as Vec3, (a, b, c) => {
            const { o, v } = at(x + a - 2, y + b - 2, z + c - 2);
            any ||= o > 0;
            [least, greatest] = [Math.min(least, v), Math.max(greatest, v)];
        });
        assert.equal(intervals[i] <= intervals[i + 1], any, `${X} ${Y} ${Z}`);
        if (any) assert.ok(intervals[i] <= least + 0.51 && intervals[i + 1] >= greatest - 0.51);
    });
    atlas.brickAt.forEach((coordinates, place) => {
        if (coordinates === 0xffffffff) return;
        const [X, Y, Z] = [coordinates & 1023, (coordinates >> 10) & 1023, coordinates >> 20];
        const across = atlas.dims.map((n) => n / 9);
        const packed = atlas.places[(Z * atlas.bricks[1] + Y) * atlas.bricks[0] + X];
        const row = ((packed >> 10) & 1023) + across[1] * (packed >> 20);
        assert.equal((packed & 1023) + across[0] * row, place);
    });
}

describe('a damaged file', () => {
    /** Decodes, and returns the sentence if it is refused. */
    const outcome = (data: Uint8Array, kind: Part['kind'] = 'vgs'): string | Atlas => {
        const begin = process.cpuUsage();
        try {
            return decode([part(data, kind)], still);
        } catch (error) {
            assert.ok(error instanceof Refusal, `${(error as Error).stack}`);
            assert.match(error.message, /^[A-Z].*\.$/);
            return error.message;
        } finally {
            assert.ok(process.cpuUsage(begin).user < 2e6, 'within two seconds of a processor');
        }
    };

    it('is found wherever a bit is wrong', () => {
        for (const name of ['binary.vgs', 'region.vgs', 'field.voxels']) {
            const bytes = bytesOf(name), kind = name.endsWith('.vgs') ? 'vgs' : 'voxels';
            assert.equal(typeof outcome(bytes, kind), 'object');
            for (let at = 0; at < bytes.length; at += 5) {
                const changed = bytes.slice();
                changed[at] ^= 1 << (at % 8);
                assert.equal(typeof outcome(changed, kind), 'string', `byte ${at} of ${name}`);
            }
        }
    });

    it('that ends early is read as far as it is whole', () => {
        for (const name of ['binary', 'region']) {
            const bytes = bytesOf(`${name}.vgs`), whole = readVgs(bytes);
            for (let end = 0; end < bytes.length; end += 7) {
                assert.equal(typeof outcome(bytes.slice(0, end)), 'string', 'no layer or no mask');
            }
            assert.equal(typeof outcome(Uint8Array.of(...bytes, 7)), 'object');
            const two = withHeader(bytes, (h) => h.layers.push({ count: 9, bytes: 90000, crc32: 1 }));
            assert.deepEqual([readVgs(two).count, readVgs(two).missing], [whole.count, 9]);
            assert.deepEqual(readVgs(two).region, whole.region);
        }
    });

    it('that lies in its header is refused or decoded, and soon', () => {
        const bytes = bytesOf('binary.vgs'), last = 0xffffffff;
        const lies: ((header: any) => void)[] = [
            (h) => (h.layers[0].count = 1e6), (h) => (h.layers[0].count = 500),
            (h) => (h.layers[0].count = 2 ** 53), (h) => (h.layers[0].count = -1),
            (h) => (h.layers[0].bytes = 2 ** 60), (h) => (h.layers[0].bytes = 1.5), (h) => (h.layers = []),
            (h) => (h.layers = {}), (h) => (h.layers = [null]), (h) => (h.exceptions.count = 1400),
            (h) => (h.exceptions = 5), (h) => (h.grid.size = [65535, 65535, 65535]),
            (h) => (h.grid.size = [last, last, last]), (h) => (h.grid.size = [0, 1, 1]),
            (h) => (h.grid.size = [2, 2, 2]), (h) => (h.grid = null), (h) => delete h.grid,
            (h) => (h.grid.affine[0] = 0),
            (h) => (h.grid.affine = h.grid.affine.map((v: number) => v * 1e-3)),
            (h) => (h.grid = { size: [4000, 4000, 4000], affine: h.affine.map((v: number) => v * 0.01) }),
            (h) => (h.grid.affine[2] = 1e9), (h) => (h.affine[2] = 1e9), (h) => (h.grid.affine[1] = -1e5),
            (h) => (h.grid = { size: [400, 400, 400], affine: h.grid.affine.map((v: number) => v * 0.06) }),
            (h) => (h.affine = h.affine.map((v: number) => v * 1e6)), (h) => (h.affine[3] = 1e300),
            (h) => (h.affine = [1]), (h) => (h.steps.mean = 0), (h) => (h.steps.ratio = 1.0001),
            (h) => (h.steps.ratio = 2), (h) => (h.steps.ratio = 1), (h) => (h.steps.opacity = 2),
            (h) => (h.steps.intensity = 1e30), (h) => (h.steps.intensity = null),
            (h) => (h.cells.side_log2 = 200), (h) => (h.cells.side_log2 = -200),
            (h) => (h.cells.side_log2 = 5), (h) => (h.cells.first = [2 ** 60, 0, 0]),
            (h) => (h.cells.first = ['a', 0, 0]), (h) => (h.ranges[0] = [-(2 ** 26), 2 ** 26]),
            (h) => (h.ranges[0] = [5, 4]), (h) => h.ranges.pop(), (h) => (h.ranges[8] = [-3, 300]),
            (h) => (h.ranges[6] = [-40, 40]), (h) => (h.ranges[2] = [0, 0]), (h) => (h.kernel = 'gated'),
            (h) => (h.kernel = 'constructor'), (h) => (h.kernel = 3), (h) => (h.form = 'field'),
            (h) => (h.form = 'grid'), (h) => (h.epsilon = -1), (h) => (h.epsilon = 1e39),
            (h) => (h.occupancy_w0 = 0), (h) => (h.occupancy_w0 = 1e-300), (h) => (h.background = 1e38),
            (h) => (h.background = 'x'), (h) => (h.intensity = 'K'), (h) => (h.labels = 'yes'),
            (h) => (h.labels = true), (h) => (h.label_names = [[1, '']]), (h) => (h.more = 1),
            (h) => (h.label_names = [[2, 'b'], [1, 'a']]), (h) => (h.label_names = [[1, 'a\u0000b']]),
            (h) => (h.__proto__ = 1), (h) => (h.grid = [h.grid]), (h) => (h.volume_crc32 = -1),
            (h) => (h.iterations = 1.5), (h) => (h.note = [[[[]]]]),
        ];
        const outcomes = lies.map((lie) => outcome(withHeader(bytes, lie)));
        assert.ok(outcomes.filter((found) => typeof found === 'string').length > 40);
        assert.ok(outcomes.filter((found) => typeof found === 'object').length > 5);
        assert.equal(typeof outcome(withHeader(bytes, () => {})), 'object');
        const ofRegion: ((header: any) => void)[] = [
            (h) => delete h.region, (h) => (h.region = null), (h) => (h.region = []),
            (h) => (h.region.crc32 = 1), (h) => h.region.bytes--, (h) => (h.region.bytes = 2 ** 60),
            (h) => (h.form = 'grid'), (h) => (h.form = 'field'), (h) => (h.grid.size = [9, 9, 9]),
            (h) => (h.grid = null),
        ];
        for (const lie of ofRegion) {
            assert.equal(typeof outcome(withHeader(bytesOf('region.vgs'), lie)), 'string', `${lie}`);
        }
    });

    it('is refused if it is none', () => {
        const next = random(5);
        for (let length = 0; length < 400; length += 40) {
            const bytes = Uint8Array.from({ length }, () => next() * 256);
            assert.equal(typeof outcome(bytes), 'string');
            assert.equal(typeof outcome(bytes, 'voxels'), 'string');
        }
        assert.match(String(outcome(bytesOf('field.voxels'))), /damaged/);
        assert.throws(() => decode([], still), Refusal);
        const both = [part(bytesOf('binary.vgs')), part(bytesOf('field.voxels'), 'voxels')];
        assert.throws(() => decode(both, still), Refusal);
    });
});

describe('a field on voxels', () => {
    // As in src/voxels.rs.
    const size: Vec3 = [21, 18, 15];
    const value = (x: number, y: number, z: number): number =>
        ((x * x * 5 + y * 40 + z * z * y) % 700) * 1.5 - 300;
    const occupancy = (x: number, y: number, z: number): number =>
        x > 0 && y > 0 && z > 0 && x < 20 && y < 17 && z < 14 && (x + 2 * y) % 9 < 6
            ? Math.min(((x + y + 2 * z) % 12) / 6, 1) : 0;

    it('comes back', () => {
        const field = readVoxels(bytesOf('field.voxels'), [[0, 4], [1, 9], [2, 30]], still);
        assert.deepEqual([field.size, field.range, field.edge], [size, [-300, 748.5], 1.5]);
        assert.deepEqual(field.worldFromVoxel, [1, 0, 0, -4, 0, 1.5, 0, 5.5, 0, 0, 2, 6]);
        everyVoxel(size, (x, y, z) => {
            const { v, o, label, known } = voxel(field, x, y, z), wanted = occupancy(x, y, z);
            assert.ok(Math.abs(o - wanted) < 0.002, `O is ${o} and not ${wanted} at ${x} ${y} ${z}`);
            let near = false;
            everyVoxel([3, 3, 3], (i, j, k) => (near ||= occupancy(x + i - 1, y + j - 1, z + k - 1) > 0));
            assert.equal(known, near);
            if (near) assert.ok(Math.abs(v - value(x, y, z)) <= 0.25, `V is ${v} and not ${value(x, y, z)}`);
            if (o > 0) assert.equal(label, [4, 9, 30][Math.floor(x / 8)]);
        });
        checkAtlas(makeAtlas(field, still), field);
    });
});

describe('the worker', () => {
    it('tells what it does, and how long each stage takes', () => {
        const told: [string, number][] = [], bytes = bytesOf('labels.vgs');
        const tell = (stage: string, share: number): unknown => told.push([stage, share]);
        const atlas = decode([part(bytes, 'vgs', [[3, 1], [7, 2]])], tell);
        assert.ok(told.every(([stage]) => /^[A-Z]/.test(stage)));
        assert.ok(told.every(([, share], i) => share >= (told[i - 1]?.[1] ?? 0)));
        assert.ok(told[told.length - 1][1] <= 1);
        assert.deepEqual(Object.keys(atlas.times), ['read', 'decode', 'arrange']);
        assert.deepEqual([...atlas.histograms.keys()].sort(), [1, 2]);
    });
});
