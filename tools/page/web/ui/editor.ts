// The editor of the transfer function: the histogram, the curve over it, points to drag, and their numbers.
import { at, extent } from '../transfer/function.ts';
import type { TransferFunction } from '../types.ts';
import type { App } from './app.ts';
import * as curve from './curve.ts';
import { button, element, fromHex, hex, iconButton, numberField, oncePerFrame, write } from './elements.ts';
import { say } from './notices.ts';
import { clamp } from './vectors.ts';

/** Greatest distance from which a point can be grasped, CSS pixels. */
const REACH = { mouse: 10, touch: 24 };
/** Heights of the strip of colours and of the axis below it, CSS pixels. */
const [STRIP, AXIS] = [10, 16];
/** Share of the visible range by which an arrow key moves; with Shift a tenth of it. */
const NUDGE = 1 / 200;
/** Width of the narrowest visible range, as a share of the full one. */
const NARROWEST = 1e-3;
/** Least number of points. */
const LEAST = 2;
/** ms within which two taps are one. */
const DOUBLE = 350;

type Range = [number, number];

const rounded = (value: number, digits: number) => `${Number(value.toPrecision(digits))}`;

export class Editor {
    readonly #app: App;
    readonly #canvas: HTMLCanvasElement;
    readonly #ring: HTMLElement;
    #points: curve.Point[] = [];
    #shown: TransferFunction | null = null;
    #selected = -1;
    /** The visible range; null: all. */
    #view: Range | null = null;
    #fingers = new Map<number, { x: number; y: number }>();
    /** What is dragged: its distance from the pointer; null: the range. */
    #held: { x: number; y: number } | null = null;
    #tapped = { time: -Infinity, x: 0, y: 0 };
    #moved = 0;
    readonly #rows: HTMLElement;
    readonly #colour: HTMLInputElement;
    readonly #intensity: HTMLInputElement;
    readonly #opacity: HTMLInputElement;
    readonly #removing: HTMLButtonElement;
    readonly #chosen: HTMLElement;
    readonly #hint: HTMLElement;
    readonly #all: HTMLButtonElement;
    readonly #window: [HTMLInputElement, HTMLInputElement];

    constructor(app: App, into: HTMLElement) {
        this.#app = app;
        const unit = app.scene.unit === 'hu' ? 'HU' : '';
        const hint =
            'Arrow keys move the point (Shift: finely), Home and End choose, Insert adds, Delete removes.';
        this.#canvas = element('canvas', {
            id: 'curve',
            tabindex: 0,
            role: 'application',
            'aria-label': `Transfer function over the histogram. ${hint}`,
        });
        this.#ring = element('div', { class: 'curve' }, this.#canvas);
        this.#colour = element('input', {
            type: 'color',
            'aria-label': 'Colour of the point',
            title: 'Colour of the point',
            input: () => this.#change(this.#selected, { colour: fromHex(this.#colour.value) }),
        });
        const name = unit ? `Intensity of the point, ${unit}` : 'Intensity of the point';
        this.#intensity = numberField(name, (intensity) => this.#change(this.#selected, { intensity }));
        this.#opacity = numberField(
            'Opacity of the point, per mm',
            (opacity) => this.#change(this.#selected, { opacity }),
            { min: 0, max: 1 },
        );
        this.#removing = iconButton('remove', 'Remove the point', () => this.#remove(this.#selected));
        this.#chosen = element(
            'span',
            { class: 'chosen' },
            this.#colour,
            this.#intensity,
            element('span', { class: 'dim' }, unit),
            this.#opacity,
            element('span', { class: 'dim' }, '/mm'),
        );
        this.#hint = element('span', { class: 'dim hint' }, 'choose a point, or add one');
        this.#all = button('All', () => this.#look(null), {
            title: 'Show all intensities',
            'aria-label': 'Show all intensities',
            class: 'push',
        });
        const width = numberField('Width of the window', (w) => this.#setWindow(w, null), { min: 1e-6 });
        const level = numberField('Level of the window', (l) => this.#setWindow(null, l));
        this.#window = [width, level];
        this.#rows = element('tbody');
        const head = ['Colour', unit || 'Intensity', 'Opacity/mm'].map((text) =>
            element('th', { scope: 'col' }, text),
        );
        into.append(
            this.#ring,
            element(
                'div',
                { class: 'row', id: 'point' },
                this.#chosen,
                this.#hint,
                iconButton('add', 'Add a point', () => this.#addBeside()),
                this.#removing,
            ),
            element(
                'div',
                { class: 'row' },
                element('span', { class: 'label' }, 'Window'),
                element('label', {}, 'W ', width),
                element('label', {}, 'L ', level),
                element('span', { class: 'dim' }, unit),
                this.#all,
            ),
            element(
                'details',
                {},
                element('summary', {}, 'Points as numbers'),
                element(
                    'table',
                    {},
                    element('thead', {}, element('tr', {}, ...head, element('td'))),
                    this.#rows,
                ),
            ),
        );
        this.#listen();
        app.on('look', () => this.#update());
        app.on('reading', () => this.#draw());
        new ResizeObserver(() => this.#draw()).observe(this.#ring);
        this.#update();
    }

    get #full(): Range {
        return curve.fullRange(this.#points, this.#app.atlas.range);
    }

    get #seen(): Range {
        const full = this.#full;
        if (!this.#view) return full;
        const [low, high] = [Math.max(this.#view[0], full[0]), Math.min(this.#view[1], full[1])];
        return low < high ? [low, high] : full;
    }

    // ---- Changes ----

    #apply(): void {
        const tf = curve.functionOf(this.#points, this.#app.look.function);
        this.#shown = tf;
        this.#app.setFunction(tf);
    }

    #change(index: number, to: Partial<curve.Point>): void {
        const point = this.#points[index];
        if (!point) return;
        if (to.colour) this.#points[index] = { ...point, colour: to.colour };
        curve.move(
            this.#points,
            index,
            to.intensity ?? point.intensity,
            to.opacity ?? point.opacity,
            this.#reach(to.intensity),
        );
        this.#apply();
    }

    /** The full range, and a number that somebody has typed. */
    #reach(typed = this.#full[0]): Range {
        return [Math.min(this.#full[0], typed), Math.max(this.#full[1], typed)];
    }

    #add(intensity: number, opacity: number): void {
        const index = curve.add(this.#points, this.#app.look.function, intensity, opacity, this.#full);
        if (index < 0) return;
        this.#apply();
        this.#select(index);
    }

    #addBeside(): void {
        const place = curve.beside(this.#points, this.#selected, this.#seen);
        this.#add(place, at(this.#app.look.function, place)[1]);
    }

    #remove(index: number): void {
        if (index < 0 || this.#points.length <= LEAST) return;
        this.#points.splice(index, 1);
        this.#apply();
        this.#select(Math.max(index - 1, 0));
    }

    #select(index: number): void {
        this.#selected = index;
        const point = this.#points[index];
        if (point) {
            const [v, o] = [rounded(point.intensity, 5), rounded(point.opacity, 3)];
            say(`Point ${index + 1} of ${this.#points.length}: ${v}, opacity ${o} per millimetre`);
        }
        this.#update();
    }

    #setWindow(width: number | null, level: number | null): void {
        const [low, high] = extent(this.#app.look.function);
        const [w, l] = [width ?? high - low, level ?? (low + high) / 2];
        this.#app.setWindow(l - w / 2, l + w / 2);
    }

    #look(view: Range | null): void {
        const full = this.#full;
        const width = view
            ? clamp(view[1] - view[0], NARROWEST * (full[1] - full[0]), full[1] - full[0])
            : Infinity;
        const low = view ? clamp(view[0], full[0], Math.max(full[1] - width, full[0])) : 0;
        this.#view = width >= full[1] - full[0] ? null : [low, low + width];
        this.#draw();
    }

    #zoom(factor: number, about: number): void {
        const [low, high] = this.#seen;
        this.#look([about + (low - about) * factor, about + (high - about) * factor]);
    }

    // ---- Mouse, touch and keys ----

    get #size(): { width: number; height: number } {
        const { clientWidth, clientHeight } = this.#canvas;
        return { width: Math.max(clientWidth, 1), height: Math.max(clientHeight - STRIP - AXIS, 1) };
    }

    #x(v: number): number {
        const [low, high] = this.#seen;
        return ((v - low) / (high - low)) * this.#size.width;
    }

    #y(opacity: number): number {
        return (1 - curve.heightOf(opacity)) * (this.#size.height - 6) + 5;
    }

    #valueAt(x: number): number {
        const [low, high] = this.#seen;
        return low + (x / this.#size.width) * (high - low);
    }

    #opacityAt(y: number): number {
        return curve.opacityOf(1 - (y - 5) / (this.#size.height - 6));
    }

    #span(pixels: number): number {
        return this.#valueAt(pixels) - this.#valueAt(0);
    }

    #pointAt(x: number, y: number, reach: number): number {
        const far = (p: curve.Point) => Math.hypot(this.#x(p.intensity) - x, this.#y(p.opacity) - y);
        const nearest = this.#points.reduce((best, p, i) => (far(p) < far(this.#points[best]) ? i : best), 0);
        return far(this.#points[nearest]) <= reach ? nearest : -1;
    }

    #listen(): void {
        const canvas = this.#canvas;
        const place = (e: PointerEvent) => {
            const { left, top } = canvas.getBoundingClientRect();
            return { x: e.clientX - left, y: e.clientY - top };
        };
        canvas.addEventListener('pointerdown', (e) => this.#press(place(e), e));
        canvas.addEventListener('pointermove', (e) => this.#drag(place(e), e));
        canvas.addEventListener('pointerup', (e) => this.#release(place(e), e));
        canvas.addEventListener('pointercancel', (e) => this.#fingers.delete(e.pointerId));
        canvas.addEventListener('contextmenu', (e) => e.preventDefault());
        canvas.addEventListener('keydown', (e) => this.#key(e));
        canvas.addEventListener(
            'wheel',
            (e) => {
                e.preventDefault();
                this.#zoom(Math.exp(e.deltaY * (e.deltaMode ? 0.05 : 0.002)), this.#valueAt(e.offsetX));
            },
            { passive: false },
        );
    }

    #press(at: { x: number; y: number }, e: PointerEvent): void {
        this.#canvas.setPointerCapture(e.pointerId);
        this.#fingers.set(e.pointerId, at);
        this.#moved = 0;
        this.#held = null;
        if (e.button !== 0 || this.#fingers.size > 1) return;
        const hit = this.#pointAt(at.x, at.y, e.pointerType === 'mouse' ? REACH.mouse : REACH.touch);
        if (hit >= 0) {
            const point = this.#points[hit];
            this.#held = { x: at.x - this.#x(point.intensity), y: at.y - this.#y(point.opacity) };
        }
        if (hit !== this.#selected) this.#select(hit);
    }

    #drag(at: { x: number; y: number }, e: PointerEvent): void {
        const before = this.#fingers.get(e.pointerId);
        if (!before) {
            this.#canvas.style.cursor = this.#pointAt(at.x, at.y, REACH.mouse) < 0 ? 'crosshair' : 'grab';
            return;
        }
        this.#fingers.set(e.pointerId, at);
        const [dx, dy] = [at.x - before.x, at.y - before.y];
        this.#moved += Math.abs(dx) + Math.abs(dy);
        const point = this.#points[this.#selected];
        if (this.#fingers.size > 1) {
            const other = [...this.#fingers].find(([id]) => id !== e.pointerId)![1];
            const gap = (p: { x: number }) => Math.max(Math.abs(p.x - other.x), 20);
            this.#zoom(gap(before) / gap(at), this.#valueAt(other.x));
        } else if (e.buttons & 2) {
            const [low, high] = extent(this.#app.look.function);
            const [level, half] = [(low + high) / 2 - this.#span(dy), (high - low + this.#span(dx)) / 2];
            this.#app.setWindow(level - half, level + half);
        } else if (this.#held && point && this.#moved > 2) {
            if (e.shiftKey) {
                this.#held = { x: this.#held.x + 0.9 * dx, y: this.#held.y + 0.9 * dy };
            }
            const [x, y] = [at.x - this.#held.x, at.y - this.#held.y];
            this.#change(this.#selected, {
                intensity: clamp(this.#valueAt(x), ...this.#full),
                opacity: this.#opacityAt(y),
            });
        } else if (!this.#held) {
            const [low, high] = this.#seen;
            const by = this.#span(-dx);
            if (this.#view) this.#look([low + by, high + by]);
        }
    }

    #release(at: { x: number; y: number }, e: PointerEvent): void {
        this.#fingers.delete(e.pointerId);
        if (e.button !== 0 || this.#moved > 6) return;
        const { time, x, y } = this.#tapped;
        const twice = e.timeStamp - time < DOUBLE && Math.hypot(at.x - x, at.y - y) < REACH.touch;
        this.#tapped = { time: twice ? -Infinity : e.timeStamp, ...at };
        if (twice && this.#pointAt(at.x, at.y, REACH.mouse) < 0)
            this.#add(this.#valueAt(at.x), this.#opacityAt(at.y));
    }

    #key(e: KeyboardEvent): void {
        const [low, high] = this.#seen;
        const part = e.shiftKey ? 0.1 : 1;
        const across = (high - low) * NUDGE * part;
        const nudge = (by: number, up: number) => {
            const p = this.#points[this.#selected];
            if (!p) return this.#select(0);
            const opacity = up ? curve.opacityOf(curve.heightOf(p.opacity) + up * part) : p.opacity;
            this.#change(this.#selected, { intensity: clamp(p.intensity + by, ...this.#full), opacity });
            this.#select(this.#selected);
        };
        const last = this.#points.length - 1;
        const actions: Record<string, () => void> = {
            ArrowLeft: () => nudge(-across, 0),
            ArrowRight: () => nudge(across, 0),
            ArrowUp: () => nudge(0, 0.02),
            ArrowDown: () => nudge(0, -0.02),
            Home: () => this.#select(Math.max(this.#selected - 1, 0)),
            End: () => this.#select(Math.min(this.#selected + 1, last)),
            Insert: () => this.#addBeside(),
            Delete: () => this.#remove(this.#selected),
            Backspace: () => this.#remove(this.#selected),
        };
        const action = actions[e.key];
        if (!action || e.ctrlKey || e.metaKey || e.altKey) return;
        e.preventDefault();
        e.stopPropagation();
        action();
    }

    // ---- What is shown ----

    #update(): void {
        const tf = this.#app.look.function;
        if (tf !== this.#shown) {
            this.#points = curve.pointsOf(tf);
            this.#shown = tf;
        }
        if (this.#selected >= this.#points.length) this.#selected = -1;
        const point = this.#points[this.#selected];
        const [w, l] = this.#window;
        const [low, high] = extent(tf);
        write(w, rounded(high - low, 5));
        write(l, rounded((low + high) / 2, 5));
        this.#chosen.hidden = !point;
        this.#hint.hidden = !!point;
        this.#removing.disabled = !point || this.#points.length <= LEAST;
        write(this.#colour, point ? hex(point.colour) : '#000000');
        write(this.#intensity, point ? rounded(point.intensity, 5) : '');
        write(this.#opacity, point ? rounded(point.opacity, 3) : '');
        this.#list();
        this.#draw();
    }

    /** The points as rows of fields. */
    #list(): void {
        while (this.#rows.childElementCount > this.#points.length) this.#rows.lastElementChild!.remove();
        while (this.#rows.childElementCount < this.#points.length)
            this.#rows.append(this.#row(this.#rows.childElementCount));
        this.#points.forEach((p, i) => {
            const [colour, intensity, opacity] = this.#rows.children[i].querySelectorAll('input');
            write(colour, hex(p.colour));
            write(intensity, rounded(p.intensity, 5));
            write(opacity, rounded(p.opacity, 3));
        });
    }

    #row(i: number): HTMLTableRowElement {
        const colour: HTMLInputElement = element('input', {
            type: 'color',
            'aria-label': `Colour of point ${i + 1}`,
            input: () => this.#change(i, { colour: fromHex(colour.value) }),
        });
        const fields = [
            colour,
            numberField(`Intensity of point ${i + 1}`, (intensity) => this.#change(i, { intensity })),
            numberField(`Opacity of point ${i + 1}`, (opacity) => this.#change(i, { opacity }), {
                min: 0,
                max: 1,
            }),
            iconButton('remove', `Remove point ${i + 1}`, () => this.#remove(i)),
        ];
        return element('tr', {}, ...fields.map((field) => element('td', {}, field)));
    }

    readonly #draw = oncePerFrame(() => {
        this.#all.hidden = !this.#view;
        const { width, height } = this.#size;
        const ratio = devicePixelRatio || 1;
        const canvas = this.#canvas;
        const tall = height + STRIP + AXIS;
        const [w, h] = [Math.round(width * ratio), Math.round(tall * ratio)];
        if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
        // On the CPU: the GPU has the picture to draw.
        const c = canvas.getContext('2d', { willReadFrequently: true })!;
        c.setTransform(ratio, 0, 0, ratio, 0, 0);
        c.clearRect(0, 0, width, tall);
        c.fillStyle = '#0c0f12';
        c.fillRect(0, 0, width, height);
        this.#drawAxis(c, width, height);
        this.#drawHistogram(c, width, height);
        this.#drawCurve(c, width, height);
        const { reading } = this.#app;
        if (reading) {
            c.fillStyle = '#ffffffa0';
            c.fillRect(this.#x(reading.value) - 0.5, 0, 1, height);
        }
    });

    #drawAxis(c: CanvasRenderingContext2D, width: number, height: number): void {
        c.font = '10px system-ui, sans-serif';
        c.textBaseline = 'alphabetic';
        for (const v of curve.ticks(this.#seen, Math.max(Math.floor(width / 56), 1))) {
            const x = this.#x(v);
            c.fillStyle = '#20262d';
            c.fillRect(Math.round(x), 0, 1, height);
            c.fillStyle = '#98a1ac';
            const text = `${v}`.replace('-', '−');
            const half = c.measureText(text).width / 2;
            c.fillText(text, clamp(x - half, 0, width - 2 * half), height + STRIP + AXIS - 3);
        }
        c.fillStyle = '#1a2026';
        for (const share of [0.25, 0.5, 0.75]) c.fillRect(0, Math.round(height * share), width, 1);
    }

    #drawHistogram(c: CanvasRenderingContext2D, width: number, height: number): void {
        const { atlas } = this.#app;
        const counts = new Float64Array(256);
        for (const [number, histogram] of atlas.histograms) {
            if (this.#app.appearance(number).visible) histogram.forEach((n, i) => (counts[i] += n));
        }
        const most = Math.log1p(Math.max(...counts)) || 1;
        const [low, high] = atlas.range;
        c.fillStyle = '#33506a';
        c.beginPath();
        c.moveTo(this.#x(low), height);
        counts.forEach((n, i) => {
            const y = height - (Math.log1p(n) / most) * (height - 8);
            c.lineTo(this.#x(low + (i / 256) * (high - low)), y);
            c.lineTo(this.#x(low + ((i + 1) / 256) * (high - low)), y);
        });
        c.lineTo(Math.min(this.#x(high), width + 1), height);
        c.fill();
    }

    #drawCurve(c: CanvasRenderingContext2D, width: number, height: number): void {
        const tf = this.#app.look.function;
        const line = new Path2D();
        for (let x = 0; x <= width; x++) {
            const [colour, opacity] = at(tf, this.#valueAt(x));
            const y = this.#y(opacity);
            c.fillStyle = hex(colour);
            c.fillRect(x, height + 2, 1, STRIP - 2);
            c.globalAlpha = 0.3;
            c.fillRect(x, y, 1, height - y);
            c.globalAlpha = 1;
            line.lineTo(x, y);
        }
        c.strokeStyle = '#e8ecf0';
        c.lineWidth = 1.5;
        c.stroke(line);
        this.#points.forEach((p, i) => {
            const chosen = i === this.#selected;
            c.beginPath();
            c.arc(this.#x(p.intensity), this.#y(p.opacity), chosen ? 6.5 : 4.5, 0, 7);
            c.fillStyle = hex(p.colour);
            c.fill();
            c.strokeStyle = chosen ? '#7cc4ff' : '#f2f4f6';
            c.lineWidth = chosen ? 2.5 : 1.2;
            c.stroke();
        });
    }
}
