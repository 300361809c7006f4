// What the page shows over itself: the keys, what it is, a report, a link.
import type { App } from './app.ts';
import { button, element, iconButton } from './elements.ts';
import { measure, type Start } from './measure.ts';
import { note } from './notices.ts';

/** Shows something until it is closed. */
function dialog(title: string, ...content: (Node | string)[]): HTMLDialogElement {
    const shown: HTMLDialogElement = element(
        'dialog',
        { 'aria-label': title },
        element(
            'header',
            {},
            element('h2', {}, title),
            iconButton('close', 'Close', () => shown.close()),
        ),
        ...content,
    );
    shown.addEventListener('close', () => shown.remove());
    shown.addEventListener('click', (e) => {
        if (e.target === shown) shown.close();
    });
    document.body.append(shown);
    shown.showModal();
    return shown;
}

const KEYS: [string, string][] = [
    ['Drag, arrow keys', 'turn'],
    ['Middle drag, Shift + drag, Shift + arrow keys, two fingers', 'move'],
    ['Wheel, + and −, pinch', 'zoom'],
    ['Right drag', 'window (across) and level (up and down)'],
    ['Ctrl + drag', 'move the light'],
    ['Double click', 'set the point about which it turns'],
    ['Click', 'set the place of the slices'],
    ['Long press, Enter in the picture', 'read the value at a place, or in the middle'],
    ['1 2 3 4 5 6', 'from the front, back, left, right, head, feet'],
    ['F', 'show the whole scene'],
    ['R', 'all as in the file'],
    ['V  D  C  X', 'slices, distance, plane, box'],
    ['Ctrl + Z, Ctrl + Y', 'undo and redo what changes the look'],
    ['Page Up, Page Down', 'previous and next transfer function'],
    ['Esc', 'no distance'],
];

export function showKeys(): void {
    const rows = KEYS.map(([keys, what]) =>
        element('tr', {}, element('th', { scope: 'row' }, keys), element('td', {}, what)),
    );
    dialog('Mouse, touch and keys', element('table', { class: 'keys' }, element('tbody', {}, ...rows)));
}

export function showAbout(app: App, start: Start): void {
    const { atlas, scene } = app;
    const count = (n: number, what: string) => `${n.toLocaleString('en')} ${what}${n === 1 ? '' : 's'}`;
    const size = `${(start.bytes / 1000).toLocaleString('en', { maximumFractionDigits: 0 })} kB`;
    const what = [
        ...(atlas.splats ? [count(atlas.splats, 'Gaussian splat')] : []),
        count(scene.objects.length, 'object'),
        `a field of ${atlas.size.map((n) => n - 2).join(' × ')} voxels of ${atlas.edge.toPrecision(3)} mm`,
    ];
    dialog(
        'About this page',
        element('p', { class: 'strong' }, 'Software for looking, not for diagnosis.'),
        element(
            'p',
            {},
            `This file of ${size} carries ${new Intl.ListFormat('en').format(what)}. ` +
                'The picture is computed here. Nothing leaves this page, and it loads nothing from anywhere.',
        ),
        element('p', {}, `Written by ${scene.program}. Licence of the program: MIT OR Apache-2.0.`),
    );
}

/** Shows text to be copied. */
function showText(title: string, hint: string, text: string): void {
    const area: HTMLTextAreaElement = element(
        'textarea',
        { readonly: true, rows: Math.min(text.split('\n').length, 18), 'aria-label': title },
        text,
    );
    const shown = dialog(
        title,
        element('p', {}, hint),
        area,
        element(
            'div',
            { class: 'row' },
            button('Copy', () => void copy(text, () => area.select()), { class: 'main' }),
        ),
    );
    shown.querySelector('button.main')?.addEventListener('click', () => area.focus());
}

async function copy(text: string, otherwise: () => void, said = 'Copied'): Promise<void> {
    try {
        await navigator.clipboard.writeText(text);
        note(said);
    } catch {
        otherwise();
    }
}

export async function copyLink(link: string): Promise<void> {
    // Where a file lies is nobody's affair, and of no use elsewhere.
    const isFile = location.protocol === 'file:';
    const text = isFile ? `#${link.split('#')[1] ?? ''}` : link;
    const hint = isFile
        ? 'Copy it, and add it to the address of the page, wherever it is opened.'
        : 'Copy it; the file must lie where it lies now.';
    const said = isFile
        ? 'Copied without the path of the file: add it to the address of the page, wherever it is opened.'
        : 'Copied';
    await copy(text, () => showText('Link to this view', hint, text), said);
}

/** Measures, and shows the report. */
export async function showMeasure(app: App, start: Start): Promise<void> {
    const stop = new AbortController();
    const bar = element('progress', { max: 1, value: 0, 'aria-label': 'Measured' });
    const running: HTMLDialogElement = dialog(
        'Measuring',
        element('p', {}, 'The scene turns for ten seconds.'),
        bar,
        element(
            'div',
            { class: 'row' },
            button('Stop', () => running.close()),
        ),
    );
    running.classList.add('aside');
    running.addEventListener('close', () => stop.abort());
    try {
        const report = await measure(app, start, (share) => (bar.value = Math.floor(share * 20) / 20), stop.signal);
        if (stop.signal.aborted) return;
        running.close();
        const hint = 'It says how fast this device draws the scene, and nothing of what the scene is.';
        showText(
            'Report',
            hint,
            JSON.stringify(report, null, 1).replace(
                /\[\s+([\d.,\s]+?)\s+\]/g,
                (_, row: string) => `[${row.replace(/\s+/g, ' ')}]`,
            ),
        );
    } catch (error) {
        running.close();
        note((error as Error).message);
    }
}
