// The reader of .vgs files (engine/splat/src/vgs). It refuses what the program refuses, and gives the same
// splats.
import type { Unit, Vec3 } from '../types.ts';
import { Decoder, Places, Tree, bitsOf } from './coder.ts';
import { GET_AGAIN, Refusal } from './refusal.ts';
import { readRegion } from './region.ts';
import type { Region } from './region.ts';
import { readValues } from './values.ts';
import type { Values } from './values.ts';

export type Kernel = 'compact' | 'gaussian' | 'density' | 'gated';
/**
 * Where a set is right: between the voxels too, at those of its grid, or at those of its region, which in
 * files of version 1 is where the occupancy is above one half, but for exceptions ('grid-binary').
 */
export type Form = 'field' | 'grid' | 'region' | 'grid-binary';

/**
 * Voxels in the world: their number along x, y, z, and the rows of the affine from their indices to mm RAS.
 */
export interface Grid {
    size: Vec3;
    affine: number[];
}

/** Splats as a file has them, or what it has in their place. */
export interface SplatSet {
    kernel: Kernel;
    background: number;
    epsilon: number;
    occupancyW0: number;
    unit: Unit;
    form: Form;
    grid: Grid | null;
    /** Rows of the affine from the space of the splats to mm RAS. */
    affine: number[];
    count: number;
    /** x, y, z of each splat. */
    means: Float64Array;
    /** The lower triangular C of each covariance CCᵀ, by rows: a; b, c; d, e, f. */
    roots: Float64Array;
    opacities: Float64Array;
    intensities: Float32Array;
    /** The label of each splat; null if the set has none. */
    labels: Uint8Array | null;
    labelNames: [number, string][];
    /** The voxels that are shown; null if the splats tell, by their occupancy. */
    region: Region | null;
    /** V of the region's voxels, for the fits of its objects that have it in place of splats. */
    voxels: Values[];
    /**
     * Of 'grid-binary', x, y, z of each voxel that is on the other side than the occupancy says, and 1 if it
     * is inside, else 0.
     */
    exceptions: Uint16Array;
    /** Number of splats that are missing because the file ends early. */
    missing: number;
}

const MARK = [0x89, 0x56, 0x47, 0x53, 0x0d, 0x0a, 0x1a, 0x0a];
/** Greatest version that is read. */
const VERSION = 2;
const LONGEST_HEADER = 1 << 20;
/** Most splats or exceptions of a byte. */
const MOST_A_BYTE = 16;
const MOST_SPLATS = 200_000_000;
/** Columns of a row: the codes of a splat, then its label. */
const COLUMNS = 9;
const CODE_LIMIT = 1 << 26;
/** Bits of a column that have models. */
const MODELLED_BITS = 12;
/** The bound of coded voxels is below this. */
const LARGEST_BOUND = 1 << 24;
/** Greatest |ln| of an entry on the diagonal of C. */
const LOG_LIMIT = 42;
/** Greatest number of steps of a coordinate in a cell. */
const MOST_STEPS = 65536;
const KERNELS: readonly string[] = ['compact', 'gaussian', 'density', 'gated'];
const FORMS: readonly string[] = ['field', 'grid', 'region', 'grid-binary'];
const UNITS: readonly string[] = ['hu', 'arbitrary', 'luminance'];
const LONGEST_NAME = 120;

interface Part {
    count: number;
    bytes: number;
    crc32: number;
}

interface Steps {
    mean: number;
    ratio: number;
    opacity: number;
    intensity: number;
}

interface Cells {
    first: Vec3;
    side_log2: number;
}

/** What is stated of the coded voxels of a fit: `step` is the intensity of a code of 1, `bound` its error. */
interface Coded {
    fit: number;
    step: number;
    bound: number;
    whole: boolean;
    slabs: Part[];
}

interface Header {
    kernel: Kernel;
    background: number;
    epsilon: number;
    occupancy_w0: number;
    intensity: Unit;
    grid?: Grid | null;
    form: Form;
    labels: boolean;
    label_names: [number, string][];
    affine: number[];
    steps: Steps;
    cells: Cells;
    ranges: [number, number][];
    region?: Part | null;
    voxels?: Coded[];
    layers: Part[];
    exceptions?: Part | null;
}

function damaged(what: string): Refusal {
    return new Refusal(`The splats of this page are damaged: ${what}. ${GET_AGAIN}`);
}

// ---- Checking what a header states ------------------------------------------------------------------------

type Check = (value: unknown) => boolean;

const isWhole = (least: number, most: number): Check => (value) =>
    Number.isInteger(value) && (value as number) >= least && (value as number) <= most;
const isU8 = isWhole(0, 255), isU32 = isWhole(0, 0xffffffff), isU64 = isWhole(0, 2 ** 64);
const isI32 = isWhole(-(2 ** 31), 2 ** 31 - 1);
const isNumber: Check = Number.isFinite;
const isText: Check = (value) => typeof value === 'string';
const isFlag: Check = (value) => typeof value === 'boolean';
const isNone: Check = (value) => value === null || value === undefined;
const either = (one: Check, other: Check): Check => (value) => one(value) || other(value);
const isList = (item: Check, length?: number): Check => (value) =>
    Array.isArray(value) && (length === undefined || value.length === length) && value.every(item);
const isPair = (one: Check, other: Check): Check => (value) =>
    Array.isArray(value) && value.length === 2 && one(value[0]) && other(value[1]);
const isObject = (fields: Record<string, Check>): Check => (value) =>
    typeof value === 'object' && value !== null && !Array.isArray(value) &&
    Object.keys(value).every((key) => Object.hasOwn(fields, key)) &&
    Object.entries(fields).every(([key, check]) => check((value as Record<string, unknown>)[key]));

const isPart = isObject({ count: isU64, bytes: isU64, crc32: isU32 });
const isAffine = isList(isNumber, 12);
const isCoded =
    isObject({ fit: isU8, step: isNumber, bound: isU32, whole: isFlag, slabs: isList(isPart) });
const isHeader = isObject({
    program: isText,
    note: isText,
    kernel: isText,
    background: isNumber,
    epsilon: isNumber,
    occupancy_w0: isNumber,
    intensity: isText,
    iterations: either(isNone, isU32),
    grid: either(isNone, isObject({ size: isList(isU32, 3), affine: isAffine })),
    volume_crc32: either(isNone, isU32),
    form: isText,
    labels: isFlag,
    label_names: isList(isPair(isU8, isText)),
    affine: isAffine,
    steps: isObject({ mean: isNumber, ratio: isNumber, opacity: isNumber, intensity: isNumber }),
    cells: isObject({ first: isList(isWhole(-(2 ** 63), 2 ** 63), 3), side_log2: isI32 }),
    ranges: isList(isPair(isI32, isI32), COLUMNS),
    region: either(isNone, isPart),
    voxels: either((value) => value === undefined, isList(isCoded)),
    layers: isList(isPart),
    exceptions: either(isNone, isPart),
});

/** The inverse of a 3 × 4 affine, by rows; not finite where there is none. */
export function inverse(m: readonly number[]): number[] {
    const [a, b, c, p, d, e, f, q, g, h, i, r] = m;
    const A = e * i - f * h, B = f * g - d * i, C = d * h - e * g, det = a * A + b * B + c * C;
    const rows = [
        [A, c * h - b * i, b * f - c * e],
        [B, a * i - c * g, c * d - a * f],
        [C, b * g - a * h, a * e - b * d],
    ].map((row) => row.map((v) => v / det));
    return rows.flatMap((row) => [...row, -(row[0] * p + row[1] * q + row[2] * r)]);
}

/** Whether a name is one line of words, as `label_name` (engine/splat/src/labels.rs) leaves it. */
function isLabelName(name: string): boolean {
    return /^\S+( \S+)*$/u.test(name) && !/\p{Cc}/u.test(name) &&
        new TextEncoder().encode(name).length <= LONGEST_NAME;
}

/** Whether a set can have what a header states. */
function isSound(header: Header): boolean {
    const { kernel, form, intensity, affine, grid, epsilon, occupancy_w0: w0, background, region } = header;
    const names = header.label_names, { voxels = [] } = header;
    const invertible = (rows: number[]): boolean => inverse(rows).every(Number.isFinite);
    return KERNELS.includes(kernel) && FORMS.includes(form) && UNITS.includes(intensity) &&
        invertible(affine) && affine.every((v) => Math.abs(v) < 1e12) &&
        (!grid || (invertible(grid.affine) && grid.size.every((n) => n > 0))) &&
        (form === 'region') === !!region && (!region || !!grid) && (voxels.length === 0 || !!region) &&
        voxels.every(({ fit, step, bound, whole }, i) => (i === 0 || fit > voxels[i - 1].fit) &&
            bound < LARGEST_BOUND && step >= 1e-30 && step < 1e30 && (!whole || step === 1)) &&
        [background, epsilon, w0].every((v) => Number.isFinite(Math.fround(v))) &&
        epsilon >= 0 && Math.fround(w0) > 0 &&
        names.every(([label, name], i) => label > (i > 0 ? names[i - 1][0] : 0) && isLabelName(name));
}

function headerOf(bytes: Uint8Array): { header: Header; end: number } {
    const marked = bytes.length >= 20 && MARK.every((byte, i) => bytes[i] === byte);
    if (!marked) throw damaged('they end in their first 20 bytes, or are none');
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const [version, length, crc] = [8, 12, 16].map((at) => view.getUint32(at, true));
    if (version < 1 || version > VERSION) {
        throw new Refusal(`The splats have version ${version} of their format, and this page reads those ` +
            `up to ${VERSION}. Make the page with the program that made the splats.`);
    }
    const text = bytes.subarray(20, 20 + length);
    const whole = length <= LONGEST_HEADER && text.length === length && crc32(text) === crc;
    if (!whole) throw damaged('their header is not as it was written');
    let header: unknown;
    try {
        header = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(text));
    } catch {
        throw damaged('their header cannot be read');
    }
    const sound = isHeader(header) && isSound(header as Header);
    if (!sound) throw damaged('their header states what no set can have');
    return { header: header as Header, end: 20 + length };
}

const CRC_TABLE = new Int32Array(256).map((_, n) => {
    for (let k = 0; k < 8; k++) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
    return n;
});

/** CRC-32 as in zip. */
export function crc32(bytes: Uint8Array): number {
    let crc = -1;
    for (let i = 0; i < bytes.length; i++) crc = CRC_TABLE[(crc ^ bytes[i]) & 255] ^ (crc >>> 8);
    return ~crc >>> 0;
}

// ---- Splats -----------------------------------------------------------------------------------------------

/** The lattice that splats are rounded to (engine/splat/src/vgs/lattice.rs). */
class Lattice {
    private readonly steps: Steps;
    private readonly cells: Cells;
    private readonly side: number;
    /** Powers of the ratio; `last` is the place of the 0th. */
    private readonly powers: Float64Array;
    private readonly last: number;
    private readonly opacities = new Map<number, number>();

    constructor(steps: Steps, cells: Cells) {
        const within = (v: number, low: number, high: number): boolean => v >= low && v <= high;
        const usable = within(steps.mean, 1e-4, 2) && within(steps.ratio, 1.0001, 2) &&
            within(steps.opacity, 1e-4, 2) && within(steps.intensity, 1e-30, 1e30);
        if (!usable) throw damaged('a step is out of range');
        if (Math.abs(cells.side_log2) > 200) throw damaged('their cells are out of range');
        const up = [1], most = Math.exp(LOG_LIMIT);
        while (up[up.length - 1] < most) up.push(up[up.length - 1] * steps.ratio);
        this.steps = steps;
        this.cells = cells;
        this.side = 2 ** cells.side_log2;
        this.last = up.length - 1;
        this.powers = Float64Array.from([...up.slice(1).reverse().map((power) => 1 / power), ...up]);
    }

    /** Writes C of a splat's codes; returns false if there is none. */
    root(codes: Int32Array, to: Float64Array, at: number): boolean {
        const { powers, last } = this, even = this.steps.ratio - 1;
        if (Math.max(Math.abs(codes[0]), Math.abs(codes[2]), Math.abs(codes[5])) > last) return false;
        const c = powers[codes[2] + last], f = powers[codes[5] + last];
        to[at] = powers[codes[0] + last];
        to[at + 1] = codes[1] * even * c;
        to[at + 2] = c;
        to[at + 3] = codes[3] * even * f;
        to[at + 4] = codes[4] * even * f;
        to[at + 5] = f;
        return true;
    }

    /** Reads where in the cell at a place the mean of a splat with this C is, and writes it. */
    mean(
        place: Places, input: Decoder, root: Float64Array, at: number, to: Float64Array, toAt: number,
    ): void {
        const a = root[at], b = root[at + 1], c = root[at + 2];
        const d = root[at + 3], e = root[at + 4], f = root[at + 5];
        // Rows of C⁻¹, whose columns' lengths are 1 / the width along each axis. Only +, -, ×, ÷ and √, in
        // the order of the program: every machine finds the same numbers of steps.
        const y = -b / (a * c), z = (b * e - c * d) / (a * c * f), w = -e / (c * f);
        const x = 1 / a, v = 1 / c;
        to[toAt] = this.coordinate(0, Math.sqrt(x * x + y * y + z * z), place, input);
        to[toAt + 1] = this.coordinate(1, Math.sqrt(v * v + w * w), place, input);
        to[toAt + 2] = this.coordinate(2, 1 / f, place, input);
    }

    private coordinate(axis: number, inverseWidth: number, place: Places, input: Decoder): number {
        const steps = Math.ceil(this.side * inverseWidth / this.steps.mean);
        const count = Math.min(Math.max(steps, 1), MOST_STEPS);
        const within = (input.even(count) + 0.5) / count;
        return Math.fround((this.cells.first[axis] + place.index(axis) + within) * this.side);
    }

    /** α of a code; not a number if the program would drop the splat. */
    opacity(code: number): number {
        let found = this.opacities.get(code);
        if (found === undefined) {
            const faint = code === 0 ? this.steps.opacity / 4 : code * this.steps.opacity;
            const logit = Math.fround(-Math.log(Math.expm1(faint)));
            found = Number.isFinite(logit) ? Math.fround(1 / (1 + Math.exp(-logit))) : NaN;
            this.opacities.set(code, found);
        }
        return found;
    }

    intensity(code: number): number {
        return Math.fround(code * this.steps.intensity);
    }
}

class Column {
    private readonly low: number;
    private readonly count: number;
    private readonly shift: number;
    private readonly tree: Tree;

    constructor([low, high]: [number, number]) {
        if (low > high || low < -CODE_LIMIT || high > CODE_LIMIT) throw damaged('a range is out of range');
        this.low = low;
        this.count = high - low + 1;
        this.shift = Math.max(bitsOf(high - low) - MODELLED_BITS, 0);
        this.tree = new Tree((high - low) >>> this.shift);
    }

    /** Reads a value; NaN if it is beyond the range. */
    read(input: Decoder): number {
        const step = (input.number(this.tree) << this.shift) | input.even(1 << this.shift);
        return step < this.count ? this.low + step : NaN;
    }
}

/** Arrays that grow as splats are read: what a header declares is not believed before. */
class Rows {
    count = 0;
    means: Float64Array = new Float64Array(0);
    roots: Float64Array = new Float64Array(0);
    opacities: Float64Array = new Float64Array(0);
    intensities: Float32Array = new Float32Array(0);
    labels: Uint8Array = new Uint8Array(0);
    private room = 0;

    reserve(room: number): void {
        if (room <= this.room) return;
        this.room = room;
        const grown = <T extends Float64Array | Float32Array | Uint8Array>(old: T, length: number): T => {
            const made = new (old.constructor as new (length: number) => T)(length);
            made.set(old);
            return made;
        };
        this.means = grown(this.means, room * 3);
        this.roots = grown(this.roots, room * 6);
        this.opacities = grown(this.opacities, room);
        this.intensities = grown(this.intensities, room);
        this.labels = grown(this.labels, room);
    }

    more(): void {
        if (this.count === this.room) this.reserve(this.room * 2 + 256);
    }
}

/** Reads the splats of a layer behind `rows`; returns false if the bytes are none. */
function readLayer(
    bytes: Uint8Array, count: number, columns: Column[], places: Places, lattice: Lattice, rows: Rows,
): boolean {
    const input = new Decoder(bytes), codes = new Int32Array(COLUMNS);
    rows.reserve(rows.count + Math.min(count, bytes.length >> 2));
    places.restart();
    for (let i = 0; i < count; i++) {
        if (places.read(input) < 0) return false;
        for (let k = 0; k < COLUMNS; k++) {
            const value = columns[k].read(input);
            if (Number.isNaN(value)) return false;
            codes[k] = value;
        }
        rows.more();
        const row = rows.count, label = codes[COLUMNS - 1];
        if (!lattice.root(codes, rows.roots, row * 6)) return false;
        lattice.mean(places, input, rows.roots, row * 6, rows.means, row * 3);
        if (codes[6] < 0 || label < 0 || label > 255 || input.isBeyond) return false;
        const opacity = lattice.opacity(codes[6]);
        const { means } = rows, place = means[row * 3] + means[row * 3 + 1] + means[row * 3 + 2];
        if (!Number.isFinite(opacity + place)) continue;
        rows.opacities[row] = opacity;
        rows.intensities[row] = lattice.intensity(codes[7]);
        rows.labels[row] = label;
        rows.count++;
    }
    return true;
}

function exceptionsOf(bytes: Uint8Array, count: number, { size }: Grid): Uint16Array | null {
    const input = new Decoder(bytes), places = new Places(), insides = [new Tree(1), new Tree(1)];
    // What a header declares is not believed before it is read.
    let found = new Uint16Array(Math.min(count, bytes.length) * 4), inside = 0;
    for (let i = 0; i < count; i++) {
        const step = places.read(input);
        if (step < 0 || (i > 0 && step === 0)) return null;
        if (i * 4 === found.length) {
            const longer = new Uint16Array(Math.min(count, 2 * i) * 4);
            longer.set(found);
            found = longer;
        }
        inside = input.number(insides[inside]);
        for (let k = 0; k < 3; k++) {
            const index = places.index(k);
            if (index >= size[k] || index > 65535) return null;
            found[i * 4 + k] = index;
        }
        if (input.isBeyond) return null;
        found[i * 4 + 3] = inside;
    }
    return found;
}

/** Reads a file; one that ends early as far as its layers are whole. */
export function readVgs(bytes: Uint8Array): SplatSet {
    const { header, end } = headerOf(bytes);
    const { layers, exceptions, grid = null, voxels: coded = [] } = header, regionPart = header.region;
    const declared = layers.reduce((sum, part) => sum + part.count, 0);
    if (declared > MOST_SPLATS) throw damaged(`${declared} splats are more than ${MOST_SPLATS}`);
    if ([...layers, exceptions].some((part) => part && part.count > part.bytes * MOST_A_BYTE)) {
        throw damaged('they are more than so few bytes can hold');
    }
    const lattice = new Lattice(header.steps, header.cells);
    const columns = header.ranges.map((range) => new Column(range));
    const places = new Places(), rows = new Rows();
    let at = end, missing = 0, whole = true;
    const take = (part: Part): Uint8Array | null => {
        whole &&= part.bytes <= bytes.length - at;
        if (!whole) return null;
        at += part.bytes;
        return bytes.subarray(at - part.bytes, at);
    };
    let region: Region | null = null;
    if (regionPart) {
        const bytes = take(regionPart);
        if (bytes && crc32(bytes) === regionPart.crc32) region = readRegion(bytes, grid!.size);
        if (!region) throw damaged('their region is not as it was written');
    }
    const voxels = coded.map(({ fit, step, bound, slabs }) => {
        const parts = slabs.map((part) => {
            const slab = take(part);
            return slab && crc32(slab) === part.crc32 ? slab : null;
        });
        const whole = parts.every((slab) => slab !== null);
        const read = whole && readValues(parts, region!, grid!.size, fit, step, bound);
        if (!read) throw damaged('their coded voxels are not as they were written');
        return read;
    });
    layers.forEach((part, i) => {
        const layer = take(part);
        if (!layer) missing += part.count;
        else if (crc32(layer) !== part.crc32 ||
            !readLayer(layer, part.count, columns, places, lattice, rows)) {
            throw damaged(`layer ${i + 1} of ${layers.length} is not as it was written`);
        }
    });
    let excepted: Uint16Array | null = new Uint16Array(0);
    if (exceptions && grid && missing === 0) {
        const last = take(exceptions), sound = last && crc32(last) === exceptions.crc32;
        excepted = sound ? exceptionsOf(last, exceptions.count, grid) : null;
        if (!excepted) throw damaged('their exceptions are not as they were written');
    }
    if (rows.count === 0 && (missing > 0 || voxels.length === 0)) {
        const early = `they end early, and ${missing} of ${declared} are missing`;
        throw damaged(missing > 0 ? early : 'there are none');
    }
    const { count } = rows;
    return {
        kernel: header.kernel,
        background: Math.fround(header.background),
        epsilon: Math.fround(header.epsilon),
        occupancyW0: Math.fround(header.occupancy_w0),
        unit: header.intensity,
        form: header.form,
        grid,
        affine: header.affine,
        count,
        means: rows.means.subarray(0, count * 3),
        roots: rows.roots.subarray(0, count * 6),
        opacities: rows.opacities.subarray(0, count),
        intensities: rows.intensities.subarray(0, count),
        labels: header.labels ? rows.labels.subarray(0, count) : null,
        labelNames: header.label_names,
        region,
        voxels,
        exceptions: excepted,
        missing,
    };
}
