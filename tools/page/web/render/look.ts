// A look as the shaders read it (engine/render/src/look.rs).
import type { Appearance, Atlas, Look, TransferFunction, Vec3 } from '../types.ts';
import { dependsOnGradient, visible } from '../transfer/function.ts';
import { type Table, tableOf, visibleBefore } from '../transfer/table.ts';
import { dot, unit } from './vectors.ts';

/** Number of objects that can have an appearance: as many as a label can number. */
const OBJECTS = 256;
/** Greatest number of clip planes (look_row.glsl). */
export const PLANES = 8;
/** A ramp of opacity over less than this, HU, is integrated between samples. */
const NARROW = 60;
const MOST_FILL = 0.5;

export interface LookTables {
    /** The scene's function, then each other one once. */
    tables: Table[];
    visibleBefore: Uint32Array;
    /** Eight numbers an object: tint, opacity, visible, function (inputs.glsl). */
    appearances: Float32Array;
    /** v₀ of the gradients. */
    dark: number;
    /** What objects leave of their O, as text, where it counts: gradients follow from it. */
    shown: string;
    preIntegrated: boolean;
    shaded: boolean;
    occluded: boolean;
    graded: boolean;
    /** OBJECTS of medium.glsl. */
    objects: 0 | 1 | 2;
}

const tables = new Map<string, Table>();

/** The table of a function; the last few are kept, since most changes of a look leave functions as they are. */
function table(tf: TransferFunction, range: [number, number], integrals: boolean): Table {
    const key = JSON.stringify([tf.colours, tf.opacities, tf.gradientOpacities, range, integrals]);
    const made = tables.get(key) ?? tableOf(tf, range, integrals);
    tables.delete(key);
    tables.set(key, made);
    if (tables.size > 64) tables.delete(tables.keys().next().value!);
    return made;
}

/** A function whose opacity changes fast is integrated between samples. */
const isNarrow = (tf: TransferFunction) => tf.opacities.some((point, i, all) =>
    i > 0 && Math.abs(point[1] - all[i - 1][1]) > 0.02 && point[0] - all[i - 1][0] < NARROW);

export function lookTables(look: Look, atlas: Atlas): LookTables {
    const functions = [look.function];
    const appearances = new Float32Array(8 * OBJECTS);
    const keys = [JSON.stringify(look.function)];
    const numbers = new Map<number, number>();
    for (const [number, object] of look.objects) {
        if (!object.function) continue;
        const key = JSON.stringify(object.function);
        let at = keys.indexOf(key);
        if (at < 0) {
            at = keys.push(key) - 1;
            functions.push(object.function);
        }
        numbers.set(number, at);
    }
    const shown: number[] = [];
    for (let number = 0; number < OBJECTS; number++) {
        const { tint, opacity, visible } = look.objects.get(number) ?? PLAIN;
        const rest = [Math.min(Math.max(opacity, 0), 1), visible ? 1 : 0, numbers.get(number) ?? 0, 0];
        appearances.set([...(tint ?? [0, 0, 0]), tint ? 1 : 0, ...rest], 8 * number);
        shown.push(rest[0] * rest[1]);
    }
    const preIntegrated = functions.some(isNarrow);
    const made = functions.map((tf) => table(tf, atlas.range, preIntegrated));
    const differs = [...look.objects.values()].some((object) => !object.visible || object.tint || object.opacity < 1);
    const objects = functions.length > 1 ? 2 : differs ? 1 : 0;
    const { shade, occlusion } = look.function.material;
    return {
        tables: made,
        visibleBefore: visibleBefore(made),
        appearances,
        dark: Math.min(...functions.map((tf) => darkOf(tf, atlas.range))),
        shown: objects ? shown.join() : '',
        preIntegrated,
        shaded: shade,
        occluded: shade && occlusion > 0,
        graded: functions.some(dependsOnGradient),
        objects,
    };
}

const PLAIN: Appearance = { visible: true, tint: null, opacity: 1, function: null };

/** The lower end of what a function shows of intensities in `range`. */
function darkOf(tf: TransferFunction, range: [number, number]): number {
    const [low, high] = visible(tf) ?? range;
    return Number.isFinite(low) ? low : Math.min(range[0], high);
}

/** The uniforms of the scene's row (look_row.glsl); `origin`: of the space of the scene, mm RAS. */
export function sceneRow(look: Look, { tables: [first], dark }: LookTables, origin: Vec3): Record<string, number[]> {
    const { material } = look.function;
    const [x, y, z] = unit(look.light.direction);
    return {
        first: [first.first],
        inverse_step: [1 / first.step],
        last: [first.length - 1],
        integral_unit: [first.integralUnit],
        inverse_gradient_step: [1 / first.gradientStep],
        dark: [dark],
        ambient: [material.ambient],
        diffuse: [material.diffuse],
        specular: [material.specular],
        power: [material.power],
        occlusion: [material.occlusion],
        // In eye space z goes away from the viewer.
        light: look.light.fixedTo === 'camera' ? [x, y, -z] : [x, y, z],
        fill: [Math.min(Math.max(look.light.fill, 0), MOST_FILL)],
        planes: look.clip.flatMap(({ normal, offset }) => [...normal, dot(normal, origin) - offset]),
    };
}
