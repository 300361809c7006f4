// The panel in the room: what is on it, how it is drawn, and what a click does. In points; in the room one is
// 1 mm.
import type { App } from '../ui/app.ts';
import { extent } from '../transfer/function.ts';
import type { Controls } from './controls.ts';
import { TEXELS } from './sheets.ts';

export const WIDTH = 400, HEIGHT = 560;
/** Height of the band of words below the panel, which is shown before the eyes. */
export const BAND = 44;
const EDGE = 16, GAP = 8, ROW = 34, LINE = 22;
/** Where what scrolls begins. */
const TOP = 102;
/** Points a second that a thumbstick at its end scrolls. */
const SCROLL = 600;
const INK = '#e8eaee', FAINT = '#a4a9b2', SIGNAL = '#f0c85a';
const PAPER = '#1c1e22', FIELD = '#33373e', CHOSEN = '#40597a';
/** What hands do. */
const HELP = [
    'Grip: carry; both hands: turn and scale.',
    'A, X: next and previous preset. B: cutting plane.',
    'Right thumbstick: window. Y, held: reset.',
    'Thumbstick pressed, open palm: this panel.',
    'Without controllers: pinch to click, grasp to carry.',
];

export type Point = { x: number; y: number };
type Box = [x: number, y: number, width: number, height: number];

/** A button, a slider or, with neither, a line of text. */
interface Widget {
    box: Box;
    text: string;
    press?: () => void;
    /** Takes a place from the left (0) to the right end (1); `at` is where it is now. */
    slide?: (part: number) => void;
    at?: number;
    chosen?: boolean;
    /** A colour to tell by. */
    swatch?: string | undefined;
    ink?: string;
}

export class Panel {
    readonly canvas = document.createElement('canvas');
    /** The quality, if it is not the best one. */
    quality = '';
    /** What is on the band. */
    words = '';
    readonly #app: App;
    readonly #controls: Controls;
    readonly #exit: () => void;
    #scroll = 0;
    /** The number of the widget that is pressed, -1 beside all; null: nothing is. */
    #pressed: number | null = null;
    #last = 0;
    #drawn = '';

    constructor(app: App, controls: Controls, exit: () => void) {
        this.#app = app;
        this.#controls = controls;
        this.#exit = exit;
        this.canvas.width = WIDTH * TEXELS;
        this.canvas.height = (HEIGHT + BAND) * TEXELS;
    }

    /** True while something on it is pressed or dragged. */
    get isPressed(): boolean {
        return this.#pressed !== null;
    }

    /** Takes where a hand presses, in each frame in which it does, and then null. */
    press(at: Point | null): void {
        if (!at) {
            this.#pressed = null;
            return;
        }
        const widgets = this.#widgets();
        if (this.#pressed === null) {
            this.#pressed = under(widgets, at);
            widgets[this.#pressed]?.press?.();
        } else if (this.#pressed < 0) {
            this.#scroll += this.#last - at.y;
        }
        this.#last = at.y;
        const { box: [x, , width], slide } = widgets[this.#pressed] ?? { box: [0, 0, 1, 1] };
        slide?.(Math.min(Math.max((at.x - x) / width, 0), 1));
    }

    /** Scrolls as a thumbstick does in a frame that lasts `seconds`; up positive. */
    stick(value: number, seconds: number): void {
        if (Math.abs(value) > 0.15) this.#scroll -= value * SCROLL * seconds;
    }

    /** All that is on the panel: first what does not scroll. */
    #widgets(): Widget[] {
        const app = this.#app, controls = this.#controls;
        const { scale } = controls.placement;
        const isReal = Math.abs(scale - 1) < 5e-3;
        const inner = WIDTH - 2 * EDGE;
        const list: Widget[] = [];
        const line = (y: number, text: string, ink = FAINT) =>
            list.push({ box: [EDGE, y, inner, LINE], text, ink });
        /** Widgets side by side, `count` of which fill the row. */
        const row = (y: number, widgets: Omit<Widget, 'box'>[], count = widgets.length) => {
            const width = (inner - (count - 1) * GAP) / count;
            widgets.forEach((widget, i) =>
                list.push({ ...widget, box: [EDGE + i * (width + GAP), y, width, ROW] }));
        };
        line(8, `Scale ${scale.toFixed(2)}${isReal ? ' (real size)' : ''}. For looking, not for diagnosis.`);
        line(30, this.quality, SIGNAL);
        row(58, [
            { text: 'Real size', press: () => controls.realSize(), chosen: isReal },
            { text: 'Plane', press: () => controls.takePlane(), chosen: controls.cuts },
            { text: 'Reset', press: () => controls.reset() },
            { text: 'Leave', press: this.#exit },
        ]);
        let y = TOP;
        const next = (height: number) => (y += height) - height;
        const { presets, objects } = app.scene;
        if (presets.length) line(next(LINE), 'Presets');
        for (let i = 0; i < presets.length; i += 2) {
            row(next(ROW + GAP), presets.slice(i, i + 2).map((preset) => ({
                text: preset.name, chosen: preset.name === app.look.function.name,
                press: () => controls.choose(preset),
            })), 2);
        }
        const [low, high] = extent(app.look.function);
        const [least, greatest] = app.atlas.range;
        const [level, width, range] = [(low + high) / 2, high - low, greatest - least];
        const unit = app.scene.unit === 'hu' ? ' HU' : '';
        line(next(LINE), `Level ${level.toFixed(0)}, width ${width.toFixed(0)}${unit}`);
        row(next(ROW + GAP), [
            {
                text: 'Level', at: (level - least) / range,
                slide: (part) => controls.setWindow(least + part * range, width),
            },
            // Finer for narrow windows.
            {
                text: 'Width', at: Math.sqrt(width / (2 * range)),
                slide: (part) => controls.setWindow(level, 2 * range * part ** 2),
            },
        ]);
        if (objects.length > 1) {
            line(next(LINE), 'Objects, and their opacity');
            for (const { number, name } of objects) {
                const { visible, opacity, tint } = app.appearance(number);
                row(next(ROW + GAP), [
                    {
                        text: name, chosen: visible,
                        swatch: tint ? `rgb(${tint.map((c) => c * 255)})` : undefined,
                        press: () => app.setAppearance(number, { visible: !visible }),
                    },
                    {
                        text: `${(100 * opacity).toFixed(0)} %`, at: opacity,
                        slide: (part) => app.setAppearance(number, { opacity: part }),
                    },
                ]);
            }
        }
        for (const text of HELP) line(next(LINE), text);
        this.#scroll = Math.min(Math.max(this.#scroll, 0), Math.max(y + EDGE - HEIGHT, 0));
        list.slice(FIXED).forEach(({ box }) => (box[1] -= this.#scroll));
        return list;
    }

    /** Draws it anew if anything has changed, and returns whether it has; `at`: where a hand points. */
    draw(at: Point | null): boolean {
        const widgets = this.#widgets();
        const pointed = at ? under(widgets, at) : -1;
        const key = JSON.stringify([widgets, pointed, this.words]);
        if (key === this.#drawn) return false;
        this.#drawn = key;
        const context = this.canvas.getContext('2d')!;
        context.setTransform(TEXELS, 0, 0, TEXELS, 0, 0);
        context.clearRect(0, 0, WIDTH, HEIGHT + BAND);
        context.textBaseline = 'middle';
        fill(context, PAPER, [0, 0, WIDTH, HEIGHT]);
        context.save();
        context.beginPath();
        context.rect(0, TOP, WIDTH, HEIGHT - TOP - GAP);
        context.clip();
        widgets.forEach((widget, i) => {
            if (!isFixed(i)) paint(context, widget, i === pointed);
        });
        context.restore();
        widgets.forEach((widget, i) => {
            if (isFixed(i)) paint(context, widget, i === pointed);
        });
        if (this.words) {
            context.font = '22px sans-serif';
            context.textAlign = 'center';
            const width = Math.min(context.measureText(this.words).width + 28, WIDTH);
            fill(context, 'rgba(0,0,0,.75)', [(WIDTH - width) / 2, HEIGHT + 4, width, BAND - 8]);
            context.fillStyle = INK;
            context.fillText(this.words, WIDTH / 2, HEIGHT + BAND / 2, WIDTH - 28);
        }
        // For lines (sheets.ts).
        context.fillStyle = '#fff';
        context.fillRect(0, HEIGHT + BAND - 1, 1, 1);
        return true;
    }
}

/** Two lines and a row of four buttons stay while the others scroll. */
const FIXED = 6;
const isFixed = (number: number) => number < FIXED;

/** The number of the widget at a place that can be pressed; -1: there is none. */
const under = (widgets: Widget[], { x, y }: Point) =>
    widgets.findIndex(({ box: [left, top, width, height], press, slide }, i) =>
        (press || slide) && isFixed(i) === y < TOP
        && x >= left && x < left + width && y >= top && y < top + height);

function fill(context: CanvasRenderingContext2D, colour: string, box: Box): void {
    context.fillStyle = colour;
    context.beginPath();
    context.roundRect(...box, 6);
    context.fill();
}

function paint(context: CanvasRenderingContext2D, widget: Widget, isPointed: boolean): void {
    const { box, text, press, slide, at, chosen, swatch, ink } = widget;
    const [x, y, width, height] = box;
    const inset = swatch ? 34 : press || slide ? 8 : 0;
    if (press || slide) fill(context, chosen ? CHOSEN : FIELD, box);
    if (slide) fill(context, CHOSEN, [x, y, width * Math.min(Math.max(at!, 0.02), 1), height]);
    if (swatch) fill(context, swatch, [x + 8, y + 8, 18, height - 16]);
    if (isPointed) {
        context.strokeStyle = INK;
        context.beginPath();
        context.roundRect(...box, 6);
        context.stroke();
    }
    context.font = '15px sans-serif';
    context.textAlign = press && !swatch ? 'center' : 'left';
    context.fillStyle = ink ?? INK;
    context.fillText(text, press && !swatch ? x + width / 2 : x + inset, y + height / 2, width - inset);
}
