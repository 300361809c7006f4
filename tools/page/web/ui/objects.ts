// The list of objects: eye, colour, opacity and function of each.
import type { SceneObject } from '../types.ts';
import type { App } from './app.ts';
import { at, extent } from '../transfer/function.ts';
import { button, element, fromHex, hex, icon, iconButton, oncePerFrame, slider, write } from './elements.ts';
import { presetOf } from './presets.ts';
import { say } from './notices.ts';

/** Number of objects from which on there is a search. */
const MANY = 10;
const NONE = 'No object is called so.';

/** Shows one object and no other, or all again if it is the only one. */
function only(app: App, number: number): void {
    const shown = app.scene.objects.filter((o) => app.appearance(o.number).visible);
    const alone = shown.length === 1 && shown[0].number === number;
    show(app, (n) => alone || n === number);
}

/** Shows the objects of which a test says so. */
function show(app: App, test: (number: number) => boolean): void {
    const objects = new Map(app.look.objects);
    for (const { number } of app.scene.objects)
        objects.set(number, { ...app.appearance(number), visible: test(number) });
    app.setLook({ objects });
}

/** One object of the list; returns what brings it up to date. */
function objectRow(app: App, object: SceneObject): { row: HTMLElement; update: () => void } {
    const { number } = object;
    const name = object.name.replaceAll('_', ' ') || 'object';
    const eye = iconButton('eye', `Show ${name}`, () =>
        app.setAppearance(number, { visible: !app.appearance(number).visible }),
    );
    const colour: HTMLInputElement = element('input', {
        type: 'color',
        'aria-label': `Colour of ${name}`,
        title: `Colour of ${name}`,
        input: () => app.setAppearance(number, { tint: fromHex(colour.value) }),
    });
    const opacity = slider(`Opacity of ${name}`, '%', (percent) =>
        app.setAppearance(number, { opacity: percent / 100 }),
    );
    opacity.setRange(0, 100, 1);
    const own = element(
        'select',
        { 'aria-label': `Function of ${name}` },
        element('option', { value: -1 }, 'Function of all'),
        ...(object.function ? [element('option', { value: -2 }, 'As in the file')] : []),
        ...app.scene.presets.map((tf, i) => element('option', { value: i }, tf.name)),
    );
    own.addEventListener('change', () => {
        const chosen = Number(own.value);
        app.setAppearance(number, {
            function: chosen === -2 ? object.function : (app.scene.presets[chosen] ?? null),
        });
    });
    const plain = button('No colour of its own', () => app.setAppearance(number, { tint: null }));
    const details = element(
        'div',
        { class: 'details', hidden: true },
        opacity.row,
        element('div', { class: 'row' }, own),
        element('div', { class: 'row' }, plain),
    );
    const more: HTMLButtonElement = iconButton(
        'more',
        `More of ${name}`,
        () => {
            details.hidden = !details.hidden;
            update();
            more.setAttribute('aria-expanded', `${!details.hidden}`);
        },
        { 'aria-expanded': 'false' },
    );
    const alone = button('Only', () => only(app, number), {
        class: 'bare',
        'aria-label': `Only ${name}`,
        title: `Show only ${name}`,
    });
    const percent = element('span', { class: 'dim percent' });
    const row = element(
        'li',
        {},
        element(
            'div',
            { class: 'object' },
            eye,
            colour,
            element('span', { class: 'name', title: object.name }, name),
            percent,
            alone,
            more,
        ),
        details,
    );
    const update = () => {
        const now = app.appearance(number);
        row.classList.toggle('hidden-object', !now.visible);
        eye.setAttribute('aria-pressed', `${now.visible}`);
        eye.replaceChildren(icon(now.visible ? 'eye' : 'shut'));
        colour.classList.toggle('untinted', !now.tint);
        const tf = now.function ?? app.look.function;
        const [low, high] = extent(tf);
        write(colour, hex(now.tint ?? at(tf, (low + high) / 2)[0]));
        opacity.set(Math.round(now.opacity * 100));
        percent.textContent = now.opacity < 1 ? `${Math.round(now.opacity * 100)} %` : '';
        plain.disabled = !now.tint;
        if (details.hidden) return;
        const usual = now.function !== null && now.function === object.function;
        own.value = `${usual ? -2 : now.function ? presetOf(app, now.function) : -1}`;
    };
    return { row, update };
}

export function objectsPanel(app: App, into: HTMLElement): void {
    const { objects } = app.scene;
    const made = objects.map((object) => objectRow(app, object));
    const none = element('p', { class: 'dim', hidden: true }, NONE);
    const list = element('ul', { class: 'objects', 'aria-label': 'Objects' }, ...made.map(({ row }) => row));
    const search: HTMLInputElement = element('input', {
        type: 'search',
        placeholder: `Search ${objects.length} objects`,
        'aria-label': 'Search objects',
        input: () => {
            const words = search.value.toLowerCase().split(/\s+/);
            made.forEach(({ row }, i) => {
                const name = objects[i].name.toLowerCase().replaceAll('_', ' ');
                row.hidden = !words.every((word) => name.includes(word));
            });
            const left = made.filter(({ row }) => !row.hidden).length;
            none.hidden = left > 0;
            say(left ? `${left} object${left === 1 ? '' : 's'}` : NONE);
        },
        keydown: (e: KeyboardEvent) => {
            if (e.key === 'Escape') search.blur();
        },
    });
    const found = () => new Set(objects.filter((_, i) => !made[i].row.hidden).map((o) => o.number));
    const several = objects.length > 1;
    into.append(...(objects.length >= MANY ? [element('div', { class: 'row' }, search)] : []));
    if (several) {
        const set = (visible: boolean) => {
            const among = found();
            show(app, (n) => (among.has(n) ? visible : app.appearance(n).visible));
        };
        into.append(
            element(
                'div',
                { class: 'row' },
                button('Show all', () => set(true)),
                button('Hide all', () => set(false)),
                button('Usual look', () => app.setUsual(), { title: 'Colours and functions as in the file' }),
            ),
        );
    }
    into.append(list, none);
    const update = () => made.forEach((object) => object.update());
    app.on('look', oncePerFrame(update));
    update();
}
