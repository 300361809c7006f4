// Offers the page in a headset: before the background of the page, or in the room.
import type { App } from '../ui/app.ts';
import { note } from '../ui/notices.ts';
import { type Report, Visit } from './visit.ts';

/** What a button says, in a word and in a few. */
const MODES = {
    'immersive-vr': ['Headset', 'View in the headset'],
    'immersive-ar': ['Room', 'View in the room'],
} as const;
type Mode = keyof typeof MODES;
const FEATURES = ['hand-tracking', 'layers'];

const NO_HEADSET = 'No headset was found. Connect one, or open this page in its browser.';
const NO_XR = 'This browser shows nothing in headsets (WebXR). Open this page in the browser of a headset.';
const INSECURE = 'Headsets show only pages that come by https, or from the same machine: '
    + 'use `vgs page --serve`.';
/** Why a session did not begin, by the name of the error. */
const REFUSED: Record<string, string> = {
    NotAllowedError: 'The browser did not let this page use the headset. Allow it when it asks.',
    SecurityError: 'The browser did not let this page use the headset. Allow it when it asks.',
    InvalidStateError: 'The headset shows another page. Leave that one first.',
    NotSupportedError: 'The headset does not offer this. Put it on, and load the page again.',
};

/** What the last session in a headset was like; null: there was none. */
export const lastVisit = (): Report | null => last;
let last: Report | null = null;

/**
 * Lets a button begin and end the view in a headset, or say why there is none. Where the room can be seen
 * behind the scene another button comes beside it.
 */
export async function offerHeadset(app: App, button: HTMLButtonElement): Promise<void> {
    const { xr } = navigator;
    const other = button.cloneNode(true) as HTMLButtonElement;
    other.removeAttribute('id');
    button.after(other);
    let modes: Mode[] = [];
    let visit: Visit | null = null;
    let isBusy = false;

    const ask = async () => {
        const all = Object.keys(MODES) as Mode[];
        const there = await Promise.all(all.map((mode) => xr?.isSessionSupported(mode).catch(() => false)));
        modes = all.filter((_, i) => there[i]);
        for (const [i, one] of [button, other].entries()) {
            const [word, text] = modes[i] ? MODES[modes[i]] : ['Headset', whyNot()];
            one.textContent = word;
            one.disabled = !modes[i];
            one.hidden = i > 0 && !modes[i];
            one.title = text;
            one.setAttribute('aria-label', text);
        }
    };
    const toggle = async (mode: Mode) => {
        if (isBusy) return;
        isBusy = true;
        try {
            if (visit) {
                await visit.session.end();
            } else {
                // Whoever waits before this is no longer taken for a click.
                const session = await xr!.requestSession(mode, { optionalFeatures: FEATURES });
                session.addEventListener('end', () => (visit = null));
                visit = await Visit.begin(app, session, mode);
                last = visit.report;
            }
        } catch (error) {
            const { name, message } = error as Error;
            note(REFUSED[name] ?? `The headset did not start (${message}). Put it on and try again.`);
        }
        isBusy = false;
    };
    [button, other].forEach((one, i) => one.addEventListener('click', () => void toggle(modes[i])));
    xr?.addEventListener('devicechange', () => void ask());
    await ask();
}

function whyNot(): string {
    if (!isSecureContext) return INSECURE;
    return navigator.xr ? NO_HEADSET : NO_XR;
}
