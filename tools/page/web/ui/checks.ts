// What comes from outside, from the file, an address or a page around this one, is looked at before it is
// taken.
import { cross, sub, unit } from '../render/vectors.ts';
import type { Appearance, Camera, Light, Material, Plane, Scene, TransferFunction, Vec3 } from '../types.ts';
import { distance } from './vectors.ts';

type Raw = Record<string, unknown>;

const isRecord = (value: unknown): value is Raw =>
    typeof value === 'object' && value !== null && !Array.isArray(value);
export const isNumber = (value: unknown, low = -1e9, high = 1e9): value is number =>
    typeof value === 'number' && value >= low && value <= high;
const isRow = (value: unknown, length: number): value is number[] =>
    Array.isArray(value) && value.length === length && value.every((n) => isNumber(n));
export const isVector = (value: unknown): value is Vec3 => isRow(value, 3);
const isColour = (value: unknown): value is Vec3 => isVector(value) && value.every((n) => n >= 0 && n <= 1);

/** Sorted rows of an intensity and shares. */
function isPoints(value: unknown, length: number, least: number): value is number[][] {
    return (
        Array.isArray(value) &&
        value.length >= least &&
        value.length <= 256 &&
        value.every(
            (row, i) =>
                isRow(row, length) &&
                row.slice(1).every((n) => n >= 0 && n <= 1) &&
                (i === 0 || value[i - 1][0] <= row[0]),
        )
    );
}

export function isMaterial(value: unknown): value is Material {
    if (!isRecord(value) || typeof value.shade !== 'boolean') return false;
    const { ambient, diffuse, specular, power, occlusion } = value;
    return [ambient, diffuse, specular, power].every((n) => isNumber(n, 0)) && isNumber(occlusion, 0, 1);
}

export function isFunction(value: unknown): value is TransferFunction {
    return (
        isRecord(value) &&
        typeof value.name === 'string' &&
        isPoints(value.colours, 4, 1) &&
        isPoints(value.opacities, 2, 1) &&
        isPoints(value.gradientOpacities, 2, 0) &&
        isMaterial(value.material)
    );
}

export function isCamera(value: unknown): value is Camera {
    if (!isRecord(value)) return false;
    const { eye, target, up, fieldOfView } = value;
    return (
        isVector(eye) &&
        isVector(target) &&
        isVector(up) &&
        isNumber(fieldOfView, 0.01, 179) &&
        distance(eye, target) > 1e-3 &&
        Math.hypot(...up) > 1e-6 &&
        Math.hypot(...cross(unit(up), unit(sub(eye, target)))) > 1e-4
    );
}

/** Eight planes are the most that are drawn. */
export function isClip(value: unknown): value is Plane[] {
    return (
        Array.isArray(value) &&
        value.length <= 8 &&
        value.every(
            (plane) =>
                isRecord(plane) &&
                isVector(plane.normal) &&
                Math.abs(Math.hypot(...plane.normal) - 1) < 1e-3 &&
                isNumber(plane.offset),
        )
    );
}

export function isLight(value: unknown): value is Light {
    return (
        isRecord(value) &&
        isVector(value.direction) &&
        Math.hypot(...value.direction) > 1e-6 &&
        (value.fixedTo === 'camera' || value.fixedTo === 'patient') &&
        isNumber(value.fill, 0, 0.5)
    );
}

/** A part of an appearance. */
export function isAppearance(value: unknown): value is Partial<Appearance> {
    if (!isRecord(value)) return false;
    const tests: Record<keyof Appearance, (v: unknown) => boolean> = {
        visible: (v) => typeof v === 'boolean',
        tint: (v) => v === null || isColour(v),
        opacity: (v) => isNumber(v, 0, 1),
        function: (v) => v === null || isFunction(v),
    };
    return Object.entries(value).every(
        ([key, v]) => Object.hasOwn(tests, key) && tests[key as keyof Appearance](v),
    );
}

const isText = (value: unknown): value is string => typeof value === 'string';
const isList = (value: unknown, test: (item: unknown) => boolean, least = 0): boolean =>
    Array.isArray(value) && value.length >= least && value.every(test);
const isFiniteRow = (length: number) => (value: unknown) =>
    isList(value, Number.isFinite) && (value as number[]).length === length;

/** A function without which nothing can be shown; what is odd in it is the file's own affair. */
function isDrawable(value: unknown): boolean {
    return (
        isRecord(value) &&
        isText(value.name) &&
        isList(value.colours, isFiniteRow(4), 1) &&
        isList(value.opacities, isFiniteRow(2), 1) &&
        isList(value.gradientOpacities, isFiniteRow(2)) &&
        isMaterial(value.material)
    );
}

function isPart(value: unknown): boolean {
    const known = isRecord(value) && (value.kind === 'vgs' || value.kind === 'voxels');
    return known && Number.isSafeInteger(value.bytes) && isList(value.numbers, isFiniteRow(2));
}

function isObject(value: unknown): boolean {
    return (
        isRecord(value) &&
        Number.isSafeInteger(value.number) &&
        isText(value.name) &&
        typeof value.visible === 'boolean' &&
        (value.tint === null || isFiniteRow(3)(value.tint)) &&
        Number.isFinite(value.opacity) &&
        (value.function === null || isDrawable(value.function))
    );
}

/** What the page needs of a scene. */
export function isScene(value: unknown): value is Scene {
    return (
        isRecord(value) &&
        [value.program, value.title, value.unit].every(isText) &&
        isList(value.parts, isPart, 1) &&
        isList(value.objects, isObject) &&
        isDrawable(value.function) &&
        isList(value.presets, isDrawable) &&
        isLight(value.light) &&
        isClip(value.clip) &&
        isCamera(value.camera) &&
        isFiniteRow(3)(value.background)
    );
}

export { isColour, isRecord };
