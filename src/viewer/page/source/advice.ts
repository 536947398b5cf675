// Messages of the server as a person at the page needs them: lengths with a prefix, and what can be done.
import { withUnit } from './colours';

const byCode: Record<string, string> = {
  no_tool: 'Press "Take the tool" (T), then again.',
  taken: 'You watch until they let go; ask them to press "Let go" (T).',
};

const byRequest: Record<string, string> = {
  set: 'The organ stays as it was: correct the value in Material or Method and apply it again.',
  scenario: 'The organ stays as it was: choose another scenario.',
  replay: 'Choose another recording in Session.',
  record: 'Look at the server\'s folder of results (--out), then record again.',
  mode: 'Choose another tool, or a scenario that has this one.',
  pose: 'Lead the tool to a place outside the organ.',
  grip: 'Choose the grasper (3) first.',
  session: 'Press Reset (R) for a whole organ; then go less deep, or have finer nodes (Panels, Method).',
};

/** What to do about an error with this code, about this request; '' where nothing is known. */
export function advice(code: string, about: string | undefined): string {
  return byCode[code] ?? byRequest[about ?? ''] ?? '';
}

/** What to do about something that the session says beside its work; '' where nothing is to be done. */
export function adviceOnLog(text: string): string {
  return /nodes are too coarse/.test(text) ? 'Here: Panels, Method, Spacing at the tool.' : '';
}

/** Lengths, forces and times below a tenth of their unit with a prefix: '0.0062 m' is '6.2 mm'. */
export function withPrefixes(text: string): string {
  return text.replace(/(?<![\w.^-])(0\.0\d+|\d+(?:\.\d+)?e-\d+) (m|N|s)\b(?![\w/^²³])/g, (_, number: string, unit: string) => {
    const [value, name] = withUnit(Number(number), unit).split(' ');
    return `${Number(value)} ${name}`;
  });
}

/** `text`, as a sentence, and then what to do. */
export function saying(text: string, then: string): string {
  const begun = withPrefixes(text).replace(/^[a-z]/, (letter) => letter.toUpperCase());
  return then === '' ? begun : `${begun.replace(/[.\s]*$/, '')}. ${then}`;
}
