// The state of the page, in one place. Whoever changes it calls a method; whoever shows it listens.
import type { Display } from '../render/display.ts';
import { moved } from '../render/vectors.ts';
import { extent, stretched } from '../transfer/function.ts';
import type {
    Appearance,
    Atlas,
    Camera,
    Light,
    Look,
    Material,
    Pick,
    Plane,
    Scene,
    SceneObject,
    TransferFunction,
    Vec3,
} from '../types.ts';
import { between, fitted, viewOf } from './camera.ts';
import { corners, distance } from './vectors.ts';

/** A box along the axes of RAS: its lower and its upper corner, mm. */
export type Box = [Vec3, Vec3];
/** What a drag with the left button or one finger does in the picture. */
export type Mode = 'turn' | 'pan' | 'window' | 'light' | 'distance';
/**
 * What has changed: how things look, the camera, the place that the slices go through, what is read under the
 * cursor, the mode, the ends of the distance, or whether the slices are shown.
 */
export type Change = 'look' | 'camera' | 'place' | 'reading' | 'mode' | 'distance' | 'panels';

/** How things look, with what the planes are to a user. */
interface Moment {
    look: Look;
    plane: Plane | null;
    box: Box | null;
    fixed: Plane[];
}

/** ms within which changes are one to be undone, and how many of them can be. */
const [TOGETHER, UNDONE] = [500, 100];
/** ms that a change of the view by a button takes. */
const TURN = 260;

const appearanceOf = ({ visible, tint, opacity, function: own }: SceneObject): Appearance => ({
    visible,
    tint,
    opacity,
    function: own,
});

/** The planes that keep a box. */
export function planesOf([low, high]: Box): Plane[] {
    return [0, 1, 2].flatMap((k) => {
        const axis = [0, 0, 0].map((_, i) => (i === k ? 1 : 0)) as Vec3;
        return [
            { normal: axis, offset: low[k] },
            { normal: axis.map((a) => -a) as Vec3, offset: -high[k] },
        ];
    });
}

/** Finds a box among planes; the last ones that make one, since a plane of its own comes first. */
function boxOf(planes: Plane[]): { box: Box | null; rest: Plane[] } {
    const found = planesOf([
        [0, 0, 0],
        [0, 0, 0],
    ]).map(({ normal }) =>
        planes.findLast((plane) => plane.normal.every((n, k) => Math.abs(n - normal[k]) < 1e-6)),
    );
    if (found.includes(undefined)) return { box: null, rest: planes };
    const ends = (side: 0 | 1) => [0, 1, 2].map((k) => (side ? -1 : 1) * found[2 * k + side]!.offset) as Vec3;
    return { box: [ends(0), ends(1)], rest: planes.filter((plane) => !found.includes(plane)) };
}

export class App {
    readonly scene: Scene;
    readonly atlas: Atlas;
    readonly display: Display;
    /** Corners of what there is to see, mm RAS. */
    readonly corners: Vec3[];
    /** The box along the axes of RAS around them. */
    readonly extent: Box;
    look: Look;
    camera: Camera;
    /** The plane that a user moves. */
    plane: Plane | null = null;
    box: Box | null = null;
    mode: Mode = 'turn';
    /** Where the slices cross, mm RAS. */
    place: Vec3;
    /** What lies under the cursor. */
    reading: Pick | null = null;
    /** Whether it is marked in the picture, where no cursor does. */
    marked = false;
    /** The ends of the measured distance, mm RAS. */
    ends: Vec3[] = [];
    /** Whether the slices are shown. */
    slices = false;
    /** Width by height of the picture. */
    aspect = 1;
    /** The planes with which the scene begins. */
    readonly firstClip: Plane[];
    /** Planes of the scene that no control moves. */
    #fixed: Plane[] = [];
    #listeners: [Change, () => void][] = [];
    #turning = 0;
    #past: Moment[] = [];
    #future: Moment[] = [];
    #lastChange = -Infinity;

    constructor(scene: Scene, atlas: Atlas, display: Display) {
        this.scene = scene;
        this.atlas = atlas;
        this.display = display;
        const { size, worldFromVoxel } = atlas;
        const top = size.map((n) => n - 1) as Vec3;
        this.corners = corners([0, 0, 0], top).map((p) => moved(worldFromVoxel, p));
        this.extent = display.bounds;
        this.place = moved(worldFromVoxel, top.map((n) => n / 2) as Vec3);
        this.camera = scene.camera;
        this.look = this.#firstLook();
        this.firstClip = this.look.clip;
    }

    on(change: Change, listener: () => void): void {
        this.#listeners.push([change, listener]);
    }

    /** Tells everybody what has changed; the display first. */
    changed(change: Change): void {
        if (change === 'look') this.display.setLook(this.look);
        if (change === 'camera') this.display.setView((aspect) => viewOf(this.camera, aspect));
        for (const [what, listener] of this.#listeners) if (what === change) listener();
    }

    // ---- How things look ----

    appearance(number: number): Appearance {
        return this.look.objects.get(number) ?? { visible: true, tint: null, opacity: 1, function: null };
    }

    /** Shows all objects through a function, but those for which a user has chosen another one. */
    setFunction(to: TransferFunction): void {
        const objects = new Map(this.look.objects);
        for (const object of this.scene.objects) {
            const now = this.appearance(object.number);
            const usual = now.function !== null && now.function === object.function;
            if (usual) objects.set(object.number, { ...now, function: null });
        }
        this.setLook({ function: to, objects });
    }

    setAppearance(number: number, change: Partial<Appearance>): void {
        const objects = new Map(this.look.objects);
        objects.set(number, { ...this.appearance(number), ...change });
        this.setLook({ objects });
    }

    /** How surfaces are lit, for all functions in use. */
    setMaterial(change: Partial<Material>): void {
        const lit = (tf: TransferFunction) => ({ ...tf, material: { ...tf.material, ...change } });
        const objects = new Map(
            [...this.look.objects].map(([number, a]) => [
                number,
                { ...a, function: a.function && lit(a.function) },
            ]),
        );
        this.setLook({ function: lit(this.look.function), objects });
    }

    /** Gives all objects the look with which the file shows them. */
    setUsual(): void {
        this.setLook({ function: this.scene.function, objects: this.#usualObjects() });
    }

    /** Lets the function span other intensities. */
    setWindow(low: number, high: number): void {
        const window = extent(this.look.function);
        const sound = low < high && Math.abs(low) < 1e12 && Math.abs(high) < 1e12 && window[0] < window[1];
        if (sound) this.setFunction(stretched(this.look.function, window, [low, high]));
    }

    setLight(change: Partial<Light>): void {
        this.setLook({ light: { ...this.look.light, ...change } });
    }

    setPlane(plane: Plane | null): void {
        this.#remember();
        this.plane = plane;
        this.setLook({ clip: this.#clip() });
    }

    setBox(box: Box | null): void {
        this.#remember();
        this.box = box;
        this.setLook({ clip: this.#clip() });
    }

    /** Takes planes of which six may be a box. */
    setClip(clip: Plane[]): void {
        this.#remember();
        this.#takeClip(clip);
        this.setLook({ clip: this.#clip() });
    }

    setLook(change: Partial<Look>): void {
        this.#remember();
        this.look = { ...this.look, ...change };
        this.changed('look');
    }

    get canUndo(): boolean {
        return this.#past.length > 0;
    }

    get canRedo(): boolean {
        return this.#future.length > 0;
    }

    /** Takes back the last change of how things look. */
    undo(): void {
        this.#go(this.#past, this.#future);
    }

    redo(): void {
        this.#go(this.#future, this.#past);
    }

    // ---- Where one looks ----

    setCamera(camera: Camera): void {
        cancelAnimationFrame(this.#turning);
        this.camera = camera;
        this.changed('camera');
    }

    /** Goes to a camera in a moment, or at once for those who want no motion. */
    turnTo(to: Camera): void {
        const from = this.camera;
        if (matchMedia('(prefers-reduced-motion: reduce)').matches) {
            this.setCamera(to);
            return;
        }
        const start = performance.now();
        const step = () => {
            const share = Math.min((performance.now() - start) / TURN, 1);
            this.setCamera(share < 1 ? between(from, to, share * share * (3 - 2 * share)) : to);
            if (share < 1) this.#turning = requestAnimationFrame(step);
        };
        cancelAnimationFrame(this.#turning);
        step();
    }

    /** Shows the whole scene. */
    fit(): void {
        this.turnTo(fitted(this.camera, this.box ? corners(...this.box) : this.corners, this.aspect));
    }

    setPlace(place: Vec3): void {
        this.place = place;
        this.changed('place');
    }

    setReading(reading: Pick | null, marked = false): void {
        this.reading = reading;
        this.marked = marked && reading !== null;
        this.changed('reading');
    }

    setSlices(shown: boolean): void {
        this.slices = shown;
        this.changed('panels');
    }

    setMode(mode: Mode): void {
        this.mode = mode;
        this.changed('mode');
    }

    /** Adds an end of the distance; a third one begins another distance. */
    addEnd(place: Vec3): void {
        this.setEnds(this.ends.length < 2 ? [...this.ends, place] : [place]);
    }

    setEnds(ends: Vec3[]): void {
        this.ends = ends;
        this.changed('distance');
    }

    /** Length of the measured distance, mm; null: there are not two ends. */
    get length(): number | null {
        return this.ends.length === 2 ? distance(this.ends[0], this.ends[1]) : null;
    }

    /** What lies at a place of the picture, CSS pixels. */
    pick(x: number, y: number): Promise<Pick | null> {
        return this.display.pick(x, y);
    }

    /** Shows the scene as the file has it. */
    reset(): void {
        this.#lastChange = -Infinity;
        this.#remember();
        this.look = this.#firstLook();
        this.setEnds([]);
        this.setMode('turn');
        this.changed('look');
        this.turnTo(this.scene.camera);
    }

    #moment(): Moment {
        return { look: this.look, plane: this.plane, box: this.box, fixed: this.#fixed };
    }

    /** Keeps what is about to change. What follows at once, as in a drag, is the same change. */
    #remember(): void {
        const now = performance.now();
        if (now - this.#lastChange > TOGETHER) {
            this.#past = [...this.#past, this.#moment()].slice(-UNDONE);
            this.#future = [];
        }
        this.#lastChange = now;
    }

    #go(from: Moment[], to: Moment[]): void {
        const moment = from.pop();
        if (!moment) return;
        to.push(this.#moment());
        this.#lastChange = -Infinity;
        this.plane = moment.plane;
        this.box = moment.box;
        this.#fixed = moment.fixed;
        this.look = moment.look;
        this.changed('look');
    }

    #clip(): Plane[] {
        const movable = this.plane ? [this.plane] : [];
        return [...this.#fixed, ...movable, ...(this.box ? planesOf(this.box) : [])];
    }

    #takeClip(clip: Plane[]): void {
        const { box, rest } = boxOf(clip);
        this.box = box;
        this.plane = rest[0] ?? null;
        this.#fixed = rest.slice(1);
    }

    #usualObjects(): Map<number, Appearance> {
        return new Map(this.scene.objects.map((object) => [object.number, appearanceOf(object)]));
    }

    #firstLook(): Look {
        const { scene } = this;
        this.#takeClip(scene.clip);
        return {
            function: scene.function,
            objects: this.#usualObjects(),
            clip: this.#clip(),
            light: scene.light,
            background: scene.background,
        };
    }
}
