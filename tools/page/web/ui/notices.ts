// What the page says: to everybody in a line that goes away, to those who hear it, or over the whole picture.
import { button, byId, element } from './elements.ts';

/** ms for which a line stays. */
const STAYS = 6000;
let hiding: ReturnType<typeof setTimeout>;

/** Says something to those who hear the page. */
export function say(text: string): void {
    byId('said').textContent = text;
}

/** Shows and says a line. */
export function note(text: string): void {
    const line = byId('note');
    line.textContent = text;
    line.hidden = false;
    clearTimeout(hiding);
    hiding = setTimeout(() => (line.hidden = true), STAYS);
}

/** Says over the picture what is wrong, and what to do. */
export function fail(what: string, todo: string, reload = false): void {
    const box = byId('failure');
    const again = button('Load the page again', () => location.reload());
    box.replaceChildren(element('h2', {}, what), element('p', {}, todo), ...(reload ? [again] : []));
    box.hidden = false;
    byId('progress').hidden = true;
}

export function mend(): void {
    byId('failure').hidden = true;
}

/** Shows how far the data has been read, 0 to 1; 1 hides it. */
export function progress(share: number, stage: string): void {
    byId('progress').hidden = share >= 1;
    byId('message').textContent = stage;
    const bar = byId<HTMLProgressElement>('bar');
    bar.hidden = false;
    bar.value = share;
}
