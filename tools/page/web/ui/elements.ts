// Elements of the page, and the few icons that it has.

type Attributes = Record<string, string | number | boolean | null | ((event: never) => void)>;

/**
 * Creates an element. Attributes that are false or null are left out; functions listen to the event of that
 * name.
 */
export function element<K extends keyof HTMLElementTagNameMap>(
    tag: K,
    attributes: Attributes = {},
    ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
        if (typeof value === 'function') made.addEventListener(name, value as EventListener);
        else if (value !== false && value !== null) made.setAttribute(name, value === true ? '' : `${value}`);
    }
    made.append(...children);
    return made;
}

export const byId = <T extends Element = HTMLElement>(id: string): T =>
    document.getElementById(id) as unknown as T;

const SVG = 'http://www.w3.org/2000/svg';

export function drawn(
    tag: string,
    attributes: Record<string, string | number>,
    ...children: (Node | string)[]
): SVGElement {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, `${value}`);
    made.append(...children);
    return made;
}

/** Paths in a square of 24. */
const ICONS = {
    turn: 'M20 12a8 8 0 1 1-2.6-5.9M20 3v4.5h-4.5',
    pan: 'M12 3v18M3 12h18M9.5 5.5 12 3l2.5 2.5m-5 13L12 21l2.5-2.5m-9-9L3 12l2.5 2.5m13-5L21 12l-2.5 2.5',
    window: 'M12 4a8 8 0 1 0 0 16ZM12 4a8 8 0 0 1 0 16M14.5 8v8M17 9.5v5',
    light: 'M8 12a4 4 0 1 0 8 0 4 4 0 1 0-8 0m4-9v2m0 14v2M3 12h2m14 0h2M6 6l1 1m10 10 1 1M6 18l1-1M17 7l1-1',
    distance: 'M3 16.5 16.5 3 21 7.5 7.5 21ZM7 12.5l2 2M10 9.5l3 3M13 6.5l2 2',
    slices: 'M12 3 3 8l9 5 9-5ZM3 12l9 5 9-5M3 16l9 5 9-5',
    save: 'M12 4v11M7.5 10.5 12 15l4.5-4.5M4 19.5h16',
    full: 'M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5',
    link: 'M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1m2 4a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1',
    help: 'M9 9a3 3 0 1 1 4.5 2.6c-1 .6-1.5 1.2-1.5 2.4M12 17.5h.01M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18Z',
    reset: 'M4 12a8 8 0 1 0 2.6-5.9M4 3v4.5h4.5',
    undo: 'M9 14 4 9l5-5M4 9h10a6 6 0 0 1 0 12h-3',
    redo: 'M15 14l5-5-5-5M20 9H10a6 6 0 0 0 0 12h3',
    panel: 'M4 5h16v14H4ZM14.5 5v14',
    eye: 'M3 12s3-6 9-6 9 6 9 6-3 6-9 6-9-6-9-6M12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6',
    shut: 'M3 10c2.5 3.5 5.5 5 9 5s6.5-1.5 9-5M5 13l-2 3M12 15v3.5M19 13l2 3',
    more: 'M5 12h1M11.5 12h1M18 12h1',
    add: 'M12 5v14M5 12h14',
    remove: 'M5 12h14',
    close: 'M6 6l12 12M18 6 6 18',
    curve: 'M3 20h18M3 17l5-1 5-9 4 2 4-5',
    objects: 'M5 6h.01M9 6h11M5 12h.01M9 12h11M5 18h.01M9 18h11',
    cut: 'M4 20 20 4M4 4h9M4 4v9M11 20h9v-9',
};
export type Icon = keyof typeof ICONS;

export function icon(name: Icon): SVGElement {
    return drawn(
        'svg',
        { viewBox: '0 0 24 24', class: 'icon', 'aria-hidden': 'true' },
        drawn('path', { d: ICONS[name] }),
    );
}

/** A button with an icon; its name is for those who do not see it, and its tip for those who do. */
export function iconButton(
    name: Icon,
    label: string,
    click: () => void,
    attributes: Attributes = {},
): HTMLButtonElement {
    return element(
        'button',
        { type: 'button', class: 'bare', title: label, 'aria-label': label, click, ...attributes },
        icon(name),
    );
}

export function button(text: string, click: () => void, attributes: Attributes = {}): HTMLButtonElement {
    return element('button', { type: 'button', click, ...attributes }, text);
}

/** A slider with its number, which can be typed. */
export interface Slider {
    row: HTMLElement;
    set(value: number): void;
    setRange(low: number, high: number, step: number): void;
}

export function slider(label: string, unit: string, changed: (value: number) => void): Slider {
    const range = element('input', { type: 'range', 'aria-label': label });
    const field = numberField(unit ? `${label}, ${unit}` : label, (value) => {
        range.value = `${value}`;
        changed(value);
    });
    range.addEventListener('input', () => {
        field.value = range.value;
        changed(range.valueAsNumber);
    });
    const filled = () => {
        const [low, high] = [Number(range.min), Number(range.max)];
        range.style.setProperty('--share', `${(100 * (range.valueAsNumber - low)) / (high - low || 1)}%`);
    };
    range.addEventListener('input', filled);
    field.addEventListener('change', filled);
    const row = element(
        'div',
        { class: 'row' },
        element('span', { class: 'label', 'aria-hidden': 'true' }, label),
        range,
        field,
    );
    return {
        row,
        set(value) {
            range.value = `${value}`;
            write(field, rounded(value, Number(range.step)));
            filled();
        },
        setRange(low, high, step) {
            for (const input of [range, field])
                Object.assign(input, { min: `${low}`, max: `${high}`, step: `${step}` });
            filled();
        },
    };
}

/** A number as text, with the digits that a step has. */
function rounded(value: number, step: number): string {
    const digits = step > 0 ? Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)) : 0;
    return `${Number(value.toFixed(digits))}`;
}

/** A field for a number; what is no number, or out of its range, is put right when it is left. */
export function numberField(
    label: string,
    changed: (value: number) => void,
    attributes: Attributes = {},
): HTMLInputElement {
    const field = element('input', { type: 'number', 'aria-label': label, step: 'any', ...attributes });
    let last = '';
    field.addEventListener('focus', () => (last = field.value));
    field.addEventListener('input', () => (field.dataset.typing = ''));
    field.addEventListener('blur', () => delete field.dataset.typing);
    field.addEventListener('change', () => {
        delete field.dataset.typing;
        if (Number.isNaN(field.valueAsNumber)) {
            field.value = last;
            return;
        }
        const ends = [
            field.min === '' ? -Infinity : Number(field.min),
            field.max === '' ? Infinity : Number(field.max),
        ];
        const value = Math.min(Math.max(field.valueAsNumber, ends[0]), ends[1]);
        field.value = last = `${value}`;
        changed(value);
    });
    return field;
}

export function checkbox(
    label: string,
    changed: (on: boolean) => void,
): { row: HTMLLabelElement; box: HTMLInputElement } {
    const box = element('input', { type: 'checkbox', change: () => changed(box.checked) });
    return { row: element('label', { class: 'check' }, box, label), box };
}

/** Display-referred red, green and blue, 0 to 1, as an input of a colour has them. */
export function hex(colour: readonly number[]): string {
    return (
        '#' +
        colour
            .map((c) =>
                Math.round(Math.min(Math.max(c, 0), 1) * 255)
                    .toString(16)
                    .padStart(2, '0'),
            )
            .join('')
    );
}

export function fromHex(text: string): [number, number, number] {
    const value = parseInt(text.slice(1), 16);
    return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}

/** Does something at the next frame of the screen, once for however often it is asked. */
export function oncePerFrame(act: () => void): () => void {
    let asked = false;
    return () => {
        if (asked) return;
        asked = true;
        requestAnimationFrame(() => {
            asked = false;
            act();
        });
    };
}

/** Sets a field, but not while somebody types in it. */
export function write(field: HTMLInputElement, value: string): void {
    if (field.value !== value && field.dataset.typing === undefined) field.value = value;
}
