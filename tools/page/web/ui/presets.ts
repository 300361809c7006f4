// The list of functions to choose from.
import type { TransferFunction } from '../types.ts';
import type { App } from './app.ts';
import { element } from './elements.ts';
import { say } from './notices.ts';

/** What makes a function show what it shows, but for how it is lit. */
const pointsOf = (tf: TransferFunction): string =>
    JSON.stringify([tf.colours, tf.opacities, tf.gradientOpacities]);

/** Index of the preset that a function is; -1: none. */
export const presetOf = (app: App, tf: TransferFunction): number => {
    const points = pointsOf(tf);
    return app.scene.presets.findIndex((preset) => pointsOf(preset) === points);
};

/** Takes the next preset, or the one before. */
export function stepPreset(app: App, by: 1 | -1): void {
    const { presets } = app.scene;
    const now = presetOf(app, app.look.function);
    const next = now < 0 ? 0 : (now + by + presets.length) % presets.length;
    if (!presets[next]) return;
    app.setFunction(presets[next]);
    say(presets[next].name);
}

/** True if things show as the file has them, but for light, visibility and colours of objects. */
function isUsual(app: App): boolean {
    const { scene, look } = app;
    const kept = scene.objects.every(
        (o) => (app.appearance(o.number).function === null) === (o.function === null),
    );
    return kept && pointsOf(look.function) === pointsOf(scene.function);
}

export function presetList(app: App, into: HTMLElement): void {
    const { function: own, presets } = app.scene;
    const select = element(
        'select',
        { id: 'preset', 'aria-label': 'Transfer function' },
        element('option', { value: 'scene' }, own.name ? `As in the file: ${own.name}` : 'As in the file'),
        ...presets.map((tf, i) => element('option', { value: i }, tf.name)),
        element('option', { value: -1, hidden: true }, 'Edited'),
    );
    select.addEventListener('change', () => {
        const chosen = presets[Number(select.value)];
        if (chosen) app.setFunction(chosen);
        else app.setUsual();
    });
    into.append(element('div', { class: 'row' }, select));
    const show = () => (select.value = isUsual(app) ? 'scene' : `${presetOf(app, app.look.function)}`);
    app.on('look', show);
    show();
}
