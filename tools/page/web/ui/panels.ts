// The panels beside the picture, and the bars of buttons.
import type { App, Mode } from './app.ts';
import { address } from './address.ts';
import { from, SIDES } from './camera.ts';
import { cuttingPanel } from './cutting.ts';
import { copyLink, showAbout, showKeys, showMeasure } from './dialogs.ts';
import { Editor } from './editor.ts';
import { button, byId, element, icon, iconButton, type Icon } from './elements.ts';
import { lightPanel } from './light.ts';
import type { Start } from './measure.ts';
import { note } from './notices.ts';
import { objectsPanel } from './objects.ts';
import { told } from './overlay.ts';
import { presetList } from './presets.ts';
import { slicesPanel } from './slices.ts';

const MODES: [Mode, string][] = [
    ['turn', 'Turn'],
    ['pan', 'Move'],
    ['window', 'Window and level'],
    ['light', 'Move the light'],
    ['distance', 'Measure a distance'],
];
/** Where there is room for one panel at a time, below the picture or beside it (page.css). */
const NARROW = '(max-width: 720px) and (orientation: portrait), (max-width: 480px), (max-height: 480px)';

/** Fills the page, and returns what keys do besides those of the picture. */
export function panels(app: App, start: Start): Record<string, () => void> {
    const section = (name: Icon, id: string, title: string, open: boolean) => {
        const content = element('div', { class: 'content', id });
        byId('panel').append(
            element(
                'details',
                { open, class: 'section', 'data-tab': id },
                element('summary', {}, icon(name), element('h2', {}, title)),
                content,
            ),
        );
        return content;
    };
    const tf = section('curve', 'function', 'Transfer function', true);
    presetList(app, tf);
    new Editor(app, tf);
    lightPanel(app, tf);
    objectsPanel(app, section('objects', 'objects', 'Objects', app.scene.objects.length > 1));
    cuttingPanel(app, section('cut', 'cutting', 'Cutting', !!app.plane || !!app.box));
    const save = async () => {
        const buttons = document.querySelectorAll<HTMLButtonElement>('.save');
        buttons.forEach((button) => (button.disabled = true));
        await savePicture(app);
        buttons.forEach((button) => (button.disabled = false));
    };
    const link = () => void address(app).then(copyLink);
    const keep = () => {
        app.reset();
        note('As in the file');
    };
    const more = section('more', 'more', 'More', false);
    more.append(
        element(
            'div',
            { class: 'row wrap', role: 'group', 'aria-label': 'View from' },
            ...['From the front', 'Back', 'Left', 'Right', 'Head', 'Feet'].map((name, i) =>
                button(name, () => app.turnTo(from(app.camera, SIDES[i]))),
            ),
            button('Whole scene', () => app.fit()),
        ),
        element(
            'div',
            { class: 'row wrap' },
            button('Save picture', save, { class: 'save' }),
            button('Copy link', link),
            button('Reset', keep),
            button('Measure', () => void showMeasure(app, start), {
                title: 'How fast this device is: ten seconds, and a report',
            }),
            button('Keys', showKeys),
            button('About', () => showAbout(app, start)),
        ),
    );
    slicesPanel(app, byId('slices'));
    tools(app);
    header(app, save, link, keep);
    tabs(app);
    reading(app);
    return { '?': showKeys };
}

function tools(app: App): void {
    const modes = MODES.map(([mode, name]) => {
        const made = iconButton(mode, name, () => app.setMode(app.mode === mode ? 'turn' : mode));
        return { mode, made };
    });
    const slices = iconButton('slices', 'Slices', () => app.setSlices(!app.slices), { class: 'bare wide' });
    byId('tools').append(...modes.map(({ made }) => made), slices);
    const show = () => {
        for (const { mode, made } of modes) made.setAttribute('aria-pressed', `${mode === app.mode}`);
        slices.setAttribute('aria-pressed', `${app.slices}`);
        app.display.canvas.dataset.mode = app.mode;
    };
    app.on('mode', () => {
        show();
        if (app.mode === 'distance') note('Choose two points in the picture');
    });
    app.on('panels', show);
    show();
}

function header(app: App, save: () => Promise<void>, link: () => void, keep: () => void): void {
    const full = iconButton(
        'full',
        'Full screen',
        () => {
            if (document.fullscreenElement) void document.exitFullscreen();
            else
                void document.documentElement
                    .requestFullscreen()
                    .catch(() => note('The browser does not allow it here'));
        },
        { hidden: !document.fullscreenEnabled },
    );
    const wide = { class: 'bare wide' };
    const panel: HTMLButtonElement = iconButton(
        'panel',
        'Panels',
        () => {
            const hidden = document.body.classList.toggle('alone');
            panel.setAttribute('aria-pressed', `${!hidden}`);
        },
        { ...wide, 'aria-pressed': 'true' },
    );
    const undo = iconButton('undo', 'Undo', () => app.undo());
    const redo = iconButton('redo', 'Redo', () => app.redo());
    const show = () => {
        undo.disabled = !app.canUndo;
        redo.disabled = !app.canRedo;
    };
    app.on('look', show);
    show();
    byId('actions').append(
        undo,
        redo,
        iconButton('reset', 'Reset: all as in the file', keep, wide),
        iconButton('link', 'Copy a link to this view', link, wide),
        iconButton('save', 'Save the picture', save, { class: 'bare wide save' }),
        iconButton('help', 'Mouse, touch and keys', showKeys, wide),
        full,
        panel,
    );
}

/** Where there is little room the panels are tabs, and one of them or none is open. */
function tabs(app: App): void {
    const names: [string, Icon, string][] = [
        ['function', 'curve', 'Function'],
        ['objects', 'objects', 'Objects'],
        ['cutting', 'cut', 'Cut'],
        ['slices', 'slices', 'Slices'],
        ['more', 'more', 'More'],
    ];
    const { body } = document;
    const narrow = matchMedia(NARROW);
    const open = (name: string) => {
        body.dataset.tab = name;
        for (const details of byId('panel').querySelectorAll('details.section')) {
            if ((details as HTMLElement).dataset.tab === name) (details as HTMLDetailsElement).open = true;
        }
        if (narrow.matches) app.setSlices(name === 'slices');
        show();
    };
    const buttons = names.map(([name, image, label]) => {
        const made = element(
            'button',
            { type: 'button', click: () => open(body.dataset.tab === name ? '' : name) },
            icon(image),
            label,
        );
        return { name, made };
    });
    const show = () =>
        buttons.forEach(({ name, made }) =>
            made.setAttribute('aria-expanded', `${body.dataset.tab === name}`),
        );
    byId('tabs').append(...buttons.map(({ made }) => made));
    app.on('panels', () => {
        body.classList.toggle('slices', app.slices);
        // A key opens them too.
        if (narrow.matches && app.slices !== (body.dataset.tab === 'slices'))
            open(app.slices ? 'slices' : '');
    });
    open('');
}

function reading(app: App): void {
    const line = byId('reading');
    app.on('reading', () => {
        line.textContent = line.title = app.reading ? told(app, app.reading) : '';
    });
}

async function savePicture(app: App): Promise<void> {
    const { display } = app;
    const { onprogress } = display;
    display.onprogress = (share) => {
        onprogress?.(share);
        if (share < 1) note(`The picture is saved when it is finished (${Math.floor(100 * share)} %)`);
    };
    try {
        const url = URL.createObjectURL(await display.snapshot());
        const name = app.scene.title.replace(/[^\p{L}\p{N}]+/gu, '-').replace(/^-|-$/g, '') || 'picture';
        element('a', { href: url, download: `${name}.png` }).click();
        setTimeout(() => URL.revokeObjectURL(url), 10_000);
        note('The picture is saved');
    } catch (error) {
        note(`The picture could not be saved: ${(error as Error).message}`);
    } finally {
        display.onprogress = onprogress;
    }
}
