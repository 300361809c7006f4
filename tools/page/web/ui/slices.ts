// Axial, coronal and sagittal slices, as radiologists see them.
import type { App } from './app.ts';
import type { Vec3 } from '../types.ts';
import { element, numberField, oncePerFrame, slider, write } from './elements.ts';
import { newest } from './newest.ts';
import { clamp, sum } from './vectors.ts';

type Axis = 0 | 1 | 2;

/** Axis of RAS across each plane, the letters at its left, right, upper and lower edge, and its colour. */
const PLANES: { axis: Axis; name: string; across: Axis; down: Axis; letters: string }[] = [
    { axis: 2, name: 'Axial', across: 0, down: 1, letters: 'RLAP' },
    { axis: 1, name: 'Coronal', across: 0, down: 2, letters: 'RLHF' },
    { axis: 0, name: 'Sagittal', across: 1, down: 2, letters: 'APHF' },
];
/** Ends of the window that shows soft tissue and bone, HU. */
const CT: [number, number] = [-200, 800];
/** Most pixels of an edge. */
const LARGEST = 512;
/** Length of a drag that widens the window by a factor of e, CSS pixels. */
const PER_E = 250;

export function slicesPanel(app: App, into: HTMLElement): void {
    const window: [number, number] = app.scene.unit === 'hu' ? [...CT] : [...app.atlas.range];
    const figures = PLANES.map((plane) => figure(app, plane, window, () => update()));
    const fields = ['Lower', 'Upper'].map((name, end) =>
        numberField(`${name} end of the window of slices`, (value) => {
            window[end] = value;
            if (window[0] >= window[1]) window[1 - end] = value + (end ? -1 : 1);
            update();
        }),
    );
    const row = element(
        'div',
        { class: 'row' },
        element('span', { class: 'label' }, 'Window'),
        fields[0],
        element('span', { class: 'dim' }, 'to'),
        fields[1],
        element('span', { class: 'dim' }, app.scene.unit === 'hu' ? 'HU' : ''),
    );
    into.append(element('div', { class: 'planes' }, ...figures.map(({ whole }) => whole)), row);
    const draw = oncePerFrame(() => {
        if (app.slices) for (const figure of figures) figure.draw();
    });
    const update = () => {
        fields.forEach((field, end) => write(field, `${Math.round(window[end] * 10) / 10}`));
        draw();
    };
    app.on('place', update);
    app.on('look', update);
    app.on('panels', update);
    new ResizeObserver(update).observe(into);
    update();
}

function figure(
    app: App,
    { axis, name, across, down, letters }: (typeof PLANES)[number],
    window: [number, number],
    changed: () => void,
): { whole: HTMLElement; draw: () => void } {
    const [low, high] = app.extent;
    const [wide, tall] = [high[across] - low[across], high[down] - low[down]];
    const canvas = element('canvas', { role: 'img' });
    // Its pixels come from the CPU.
    canvas.getContext('2d', { willReadFrequently: true });
    const [vertical, horizontal] = [
        element('i', { class: 'line vertical' }),
        element('i', { class: 'line horizontal' }),
    ];
    const marks = [...letters].map((letter, i) =>
        element(
            'span',
            { class: `mark ${['left', 'right', 'top', 'bottom'][i]}`, 'aria-hidden': 'true' },
            letter,
        ),
    );
    const frame = element('div', { class: 'slice' }, canvas, vertical, horizontal, ...marks);
    frame.style.aspectRatio = `${wide} / ${tall}`;
    const place = slider(name, 'mm', (value) => move(axis, value));
    place.setRange(Math.ceil(low[axis]), Math.floor(high[axis]), 0.5);
    const whole = element('figure', { class: name.toLowerCase() }, frame, place.row);
    const move = (k: Axis, value: number) => {
        const to = [...app.place] as Vec3;
        to[k] = clamp(value, low[k], high[k]);
        app.setPlace(to);
    };
    let dragged: PointerEvent | null = null;
    const under = (e: PointerEvent): Vec3 => {
        const { left, top, width, height } = frame.getBoundingClientRect();
        const { from, across: x, down: y } = app.display.plane(axis, app.place[axis]);
        return sum(
            [from, x, y],
            [1, clamp((e.clientX - left) / width, 0, 1), clamp((e.clientY - top) / height, 0, 1)],
        );
    };
    const reader = newest(
        (place: Vec3) => app.display.valueAt(place),
        (found) => app.setReading(found),
    );
    const point = (e: PointerEvent) => {
        app.setPlace(under(e));
        reader.want(app.place);
    };
    frame.addEventListener('pointerdown', (e) => {
        frame.setPointerCapture(e.pointerId);
        dragged = e;
        if (e.button === 0) point(e);
    });
    frame.addEventListener('pointermove', (e) => {
        if (!dragged) {
            reader.want(under(e));
            return;
        }
        if (e.buttons & 2) {
            const [level, half] = [(window[0] + window[1]) / 2, (window[1] - window[0]) / 2];
            const l = level - (2 * half * (e.clientY - dragged.clientY)) / PER_E;
            const h = half * Math.exp((e.clientX - dragged.clientX) / PER_E);
            [window[0], window[1]] = [l - h, l + h];
            changed();
        } else if (e.buttons & 1) point(e);
        dragged = e;
    });
    frame.addEventListener('pointerup', () => (dragged = null));
    frame.addEventListener('pointercancel', () => (dragged = null));
    // What a finger has read stays when it is lifted.
    frame.addEventListener('pointerleave', (e) => {
        if (e.pointerType !== 'mouse') return;
        reader.forget();
        app.setReading(null);
    });
    frame.addEventListener('contextmenu', (e) => e.preventDefault());
    frame.addEventListener(
        'wheel',
        (e) => {
            e.preventDefault();
            move(axis, app.place[axis] - Math.sign(e.deltaY) * app.atlas.edge);
        },
        { passive: false },
    );
    const draw = () => {
        const { clientWidth, clientHeight } = frame;
        if (clientWidth === 0) return;
        const scale = Math.min(devicePixelRatio || 1, LARGEST / Math.max(clientWidth, clientHeight));
        const [w, h] = [clientWidth, clientHeight].map((n) => Math.max(Math.round(n * scale), 1));
        if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
        app.display.slice(axis, app.place[axis], window, canvas);
        place.set(Math.round(app.place[axis] * 2) / 2);
        canvas.setAttribute('aria-label', `${name} slice at ${app.place[axis].toFixed(1)} mm`);
        vertical.style.left = `${(100 * (high[across] - app.place[across])) / wide}%`;
        horizontal.style.top = `${(100 * (high[down] - app.place[down])) / tall}%`;
    };
    return { whole, draw };
}
