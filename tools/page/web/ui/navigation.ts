// Mouse, touch and keys in the picture. As in the desktop viewer (docs/use/viewer.md): a drag turns, the
// middle button or Shift moves, the right button changes window and level, Ctrl moves the light, the wheel
// zooms.
import { extent } from '../transfer/function.ts';
import type { Pick } from '../types.ts';
import type { App, Mode } from './app.ts';
import { about, from, panned, rolled, SIDES, turned, zoomed } from './camera.ts';
import { facing } from './cutting.ts';
import { byId } from './elements.ts';
import { dragLight } from './light.ts';
import { newest } from './newest.ts';
import { note, say } from './notices.ts';
import { told } from './overlay.ts';
import { stepPreset } from './presets.ts';

/** Length of a drag that turns by a radian, CSS pixels. */
const PER_RADIAN = 172;
/** Length of a drag that changes the window by a factor of e, CSS pixels. */
const PER_E = 250;
/** How far a pointer may go in a click, CSS pixels. */
const STILL = 6;
/** ms after which a finger that rests reads, and within which two clicks are one. */
const [LONG, DOUBLE] = [450, 350];
/** An arrow key turns by 5°; with Shift it moves by a part of the picture. */
const [STEP, SHIFT] = [Math.PI / 36, 0.03];
/** ms for which the cursor rests before what lies under it is read. */
const REST = 40;

interface Finger {
    x: number;
    y: number;
}

export function navigation(app: App, keys: Record<string, () => void>): void {
    new Navigation(app, keys);
}

class Navigation {
    readonly #app: App;
    readonly #canvas: HTMLCanvasElement;
    readonly #fingers = new Map<number, Finger>();
    #mode: Mode = 'turn';
    /** The finger has moved, or another one came: no click. */
    #moved = 0;
    #clicked = { time: -Infinity, x: 0, y: 0 };
    #long: ReturnType<typeof setTimeout> | undefined;
    /** A finger reads what lies under it. */
    #reads = false;
    #resting: ReturnType<typeof setTimeout> | undefined;
    /** What lies at a place of the picture; `place`: the slices go there, too. */
    readonly #reader = newest(
        ({ x, y }: Finger & { place: boolean }) => this.#app.pick(x, y),
        (found, { place }) => {
            this.#app.setReading(found, place);
            if (found && place) this.#app.setPlace(found.place);
        },
    );

    constructor(app: App, keys: Record<string, () => void>) {
        this.#app = app;
        const canvas = app.display.canvas;
        this.#canvas = canvas;
        canvas.addEventListener('pointerdown', this.#press);
        canvas.addEventListener('pointermove', this.#move);
        canvas.addEventListener('pointerup', this.#release);
        canvas.addEventListener('pointercancel', this.#cancel);
        canvas.addEventListener('pointerleave', this.#leave);
        canvas.addEventListener('contextmenu', (e) => e.preventDefault());
        canvas.addEventListener('wheel', this.#wheel, { passive: false });
        document.addEventListener('keydown', (e) => this.#key(e, keys));
    }

    /** A place in shorter sides of the picture, to the right of and above its middle. */
    #share({ x, y }: Finger): [number, number] {
        const { clientWidth: w, clientHeight: h } = this.#canvas;
        return [(x - w / 2) / Math.min(w, h), (h / 2 - y) / Math.min(w, h)];
    }

    #press = (e: PointerEvent): void => {
        const { offsetX: x, offsetY: y } = e;
        this.#canvas.setPointerCapture(e.pointerId);
        this.#fingers.set(e.pointerId, { x, y });
        this.#moved = this.#fingers.size > 1 ? STILL + 1 : 0;
        clearTimeout(this.#long);
        this.#reads = false;
        const command = e.ctrlKey || e.metaKey;
        const buttons: (Mode | null)[] = [
            e.shiftKey ? 'pan' : command ? 'light' : this.#app.mode,
            'pan',
            'window',
        ];
        this.#mode = buttons[e.button] ?? 'turn';
        if (e.pointerType === 'mouse') return;
        this.#unread();
        if (this.#fingers.size > 1) return;
        this.#long = setTimeout(() => {
            this.#reads = true;
            this.#reader.want({ x, y, place: true });
        }, LONG);
    };

    #move = (e: PointerEvent): void => {
        const { offsetX: x, offsetY: y } = e;
        const before = this.#fingers.get(e.pointerId);
        if (!before) {
            clearTimeout(this.#resting);
            const read = () => this.#reader.want({ x, y, place: false });
            if (e.pointerType === 'mouse') this.#resting = setTimeout(read, REST);
            return;
        }
        const [dx, dy] = [x - before.x, y - before.y];
        if (dx === 0 && dy === 0) return;
        this.#moved += Math.hypot(dx, dy);
        if (this.#moved > STILL) clearTimeout(this.#long);
        this.#fingers.set(e.pointerId, { x, y });
        if (this.#reads) this.#reader.want({ x, y, place: true });
        else if (this.#fingers.size > 1) this.#pinch(e.pointerId, before);
        else if (this.#moved > STILL || e.pointerType === 'mouse') this.#drag(dx, dy);
    };

    #drag(dx: number, dy: number): void {
        const app = this.#app;
        const { clientWidth: w, clientHeight: h } = this.#canvas;
        if (this.#mode === 'pan') {
            const size = Math.min(w, h);
            app.setCamera(panned(app.camera, dx / size, -dy / size));
        } else if (this.#mode === 'window') {
            const [low, high] = extent(app.look.function);
            const half = 0.5 * (high - low) * Math.exp(dx / PER_E);
            const level = 0.5 * (low + high) - ((high - low) * dy) / PER_E;
            app.setWindow(level - half, level + half);
            byId('reading').textContent =
                `W ${(2 * half).toFixed(0)}  L ${level.toFixed(0).replace('-', '−')}`;
        } else if (this.#mode === 'light') {
            dragLight(app, dx, dy, h / 2);
        } else {
            app.setCamera(turned(app.camera, -dx / PER_RADIAN, dy / PER_RADIAN));
        }
    }

    /** Two fingers: what is between them stays between them. */
    #pinch(id: number, before: Finger): void {
        const app = this.#app;
        const [[, other]] = [...this.#fingers].filter(([key]) => key !== id);
        const now = this.#fingers.get(id)!;
        const gap = (p: Finger) => Math.max(Math.hypot(p.x - other.x, p.y - other.y), 10);
        const angle = (p: Finger) => Math.atan2(other.y - p.y, p.x - other.x);
        const middle = (p: Finger) => this.#share({ x: (p.x + other.x) / 2, y: (p.y + other.y) / 2 });
        const [a, b] = [middle(before), middle(now)];
        const by = angle(now) - angle(before);
        const roll = Math.atan2(Math.sin(by), Math.cos(by));
        let camera = panned(app.camera, b[0] - a[0], b[1] - a[1]);
        camera = zoomed(camera, gap(before) / gap(now), b[0], b[1]);
        // Turned about the middle of the picture, and then back to the fingers.
        const [sine, cosine] = [Math.sin(roll), Math.cos(roll)];
        const turnedMiddle = [b[0] * cosine - b[1] * sine, b[0] * sine + b[1] * cosine];
        camera = panned(rolled(camera, -roll), b[0] - turnedMiddle[0], b[1] - turnedMiddle[1]);
        app.setCamera(camera);
    }

    #release = (e: PointerEvent): void => {
        clearTimeout(this.#long);
        this.#fingers.delete(e.pointerId);
        if (this.#reads || this.#moved > STILL || e.button !== 0) return;
        const { offsetX: x, offsetY: y } = e;
        const { time, x: lastX, y: lastY } = this.#clicked;
        const twice = e.timeStamp - time < DOUBLE && Math.hypot(x - lastX, y - lastY) < 4 * STILL;
        this.#clicked = { time: twice ? -Infinity : e.timeStamp, x, y };
        void this.#click(x, y, twice);
    };

    #cancel = (e: PointerEvent): void => {
        clearTimeout(this.#long);
        this.#fingers.delete(e.pointerId);
    };

    async #click(x: number, y: number, twice: boolean): Promise<void> {
        const app = this.#app;
        const found = await app.pick(x, y);
        if (!found) return;
        if (app.mode === 'distance') this.#measure(found);
        else if (twice) app.turnTo(about(app.camera, found.place));
        else app.setPlace(found.place);
    }

    #measure({ place }: Pick): void {
        const app = this.#app;
        app.addEnd(place);
        if (app.length !== null) say(`Distance ${app.length.toFixed(1)} mm`);
    }

    /** What a finger has read stays when it is lifted. */
    #leave = (e: PointerEvent): void => {
        if (e.pointerType === 'mouse' && this.#fingers.size === 0) this.#unread();
    };

    #unread(): void {
        clearTimeout(this.#resting);
        this.#reader.forget();
        this.#app.setReading(null);
    }

    #wheel = (e: WheelEvent): void => {
        e.preventDefault();
        // A pinch on a touchpad arrives as a wheel with Ctrl.
        const lines = e.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
        const factor = Math.exp((e.deltaY * lines * (e.ctrlKey ? 4 : 1)) / (2 * PER_E));
        this.#app.setCamera(zoomed(this.#app.camera, factor, ...this.#share({ x: e.offsetX, y: e.offsetY })));
    };

    #key(e: KeyboardEvent, more: Record<string, () => void>): void {
        const target = e.target as HTMLElement;
        const typing = target.matches('input:not([type=checkbox]), select, textarea');
        const app = this.#app;
        const free = !typing && !e.altKey && !document.querySelector('dialog[open]');
        const letter = e.key.toLowerCase();
        if (free && (e.ctrlKey || e.metaKey) && (letter === 'z' || letter === 'y')) {
            e.preventDefault();
            if (e.shiftKey || letter === 'y') app.redo();
            else app.undo();
        }
        if (!free || e.ctrlKey || e.metaKey) return;
        const arrow = (x: number, y: number) => () =>
            app.setCamera(
                e.shiftKey
                    ? panned(app.camera, -x * SHIFT, -y * SHIFT)
                    : turned(app.camera, x * STEP, y * STEP),
            );
        const near = (factor: number) => () => app.setCamera(zoomed(app.camera, factor, 0, 0));
        const actions: Record<string, () => void> = {
            ArrowLeft: arrow(-1, 0),
            ArrowRight: arrow(1, 0),
            ArrowUp: arrow(0, 1),
            ArrowDown: arrow(0, -1),
            '+': near(0.9),
            '=': near(0.9),
            '-': near(1 / 0.9),
            f: () => app.fit(),
            r: () => {
                app.reset();
                note('As in the file');
            },
            d: () => app.setMode(app.mode === 'distance' ? 'turn' : 'distance'),
            v: () => app.setSlices(!app.slices),
            c: () => app.setPlane(app.plane ? null : facing(app)),
            x: () => app.setBox(app.box ? null : app.extent),
            PageUp: () => stepPreset(app, -1),
            PageDown: () => stepPreset(app, 1),
            Escape: () => {
                app.setMode('turn');
                app.setEnds([]);
            },
            ...more,
        };
        SIDES.forEach(
            (side, i) =>
                (actions[i + 1] = () => {
                    app.turnTo(from(app.camera, side));
                    say(`Seen from ${side}`);
                }),
        );
        if (target === this.#canvas) actions.Enter = () => void this.#readMiddle();
        const action = actions[e.key.length === 1 ? e.key.toLowerCase() : e.key];
        if (!action || (target.matches('button, summary, a') && /^(Enter| )$/.test(e.key))) return;
        e.preventDefault();
        action();
    }

    /** Reads what is in the middle of the picture, for those without a mouse. */
    async #readMiddle(): Promise<void> {
        const app = this.#app;
        const found = await app.pick(this.#canvas.clientWidth / 2, this.#canvas.clientHeight / 2);
        app.setReading(found, true);
        say(found ? told(app, found) : 'Nothing is in the middle of the picture');
        if (!found) return;
        app.setPlace(found.place);
        if (app.mode === 'distance') this.#measure(found);
    }
}
