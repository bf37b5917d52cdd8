// German labels beside the English ones, chosen by the browser's language. Sentences stay as the service writes them.

/** Whole labels only: English = German. */
const GERMAN = `
Clutches = Kupplungen; All clutches = Alle Kupplungen; Clutch = Kupplung; Alarms = Alarme; Help = Hilfe; Send runs = Läufe senden;
Register a clutch = Kupplung anmelden; Print report = Bericht drucken; Units = Einheiten; More = Mehr; Compare = Vergleichen;
Overview = Übersicht; Diagnosis = Diagnose; Curves = Kurven; Loops = Schleifen; Engagements = Schaltungen; Runs = Läufe; History = Verlauf;
State = Zustand; What to do = Was zu tun ist; Safe for, cycles = Sicher für, Schaltspiele; Health = Gesundheit; Last run = Letzter Lauf;
Sort = Sortieren; what needs somebody = was jemanden braucht; name = Name; grouped by kind = nach Bauart; Archived = Archiviert; Find = Suchen;
Failure = Ausfall; Maintenance required = Wartungsbedarf; Function check = Funktionskontrolle;
Out of specification = Außerhalb der Spezifikation; Table = Tabelle; Show all = Alles zeigen; Cancel = Abbrechen; Close = Schließen;
Remaining cycles = Restliche Schaltspiele; Safe for, cycles (95 %) = Sicher für, Schaltspiele (95 %); Threshold = Schwelle;
Mean COF = Mittlerer Reibwert; mean COF = mittlerer Reibwert; Mean COF, tracked = Mittlerer Reibwert, verfolgt;
Mean COF, measured = Mittlerer Reibwert, gemessen; Duty cycles so far = Schaltspiele bisher; How it ages = Wie sie altert;
Correction = Korrektur; None = Keine; Tests and runs = Versuche und Läufe; Corrected for = Korrigiert um; The last tests = Die letzten Versuche;
Reaches end of life = Erreicht das Lebensende; Cycles = Schaltspiele; cycles = Schaltspiele; duty cycles = Schaltspiele; Test = Versuch;
Fits acceptable = Brauchbare Anpassungen; Events: = Ereignisse:; Diagnosis: = Diagnose:; Made of: = Grundlage:;
Mean COF against its threshold = Mittlerer Reibwert und Schwelle; Mean COF by pressure = Mittlerer Reibwert nach Druck;
Shudder margin = Abstand zum Rupfen; Stribeck curves = Stribeck-Kurven; Lines of equal torque = Linien gleichen Moments;
Stribeck parameters = Stribeck-Parameter; Friction loops = Reibschleifen; Pressure = Druck; Quantity = Größe; Cut at = Schnitt bei;
pressure, bar = Druck, bar; sliding speed, rpm = Gleitdrehzahl, 1/min; speed, rpm = Drehzahl, 1/min; time, s = Zeit, s; torque, Nm = Moment, Nm;
measured = gemessen; fit = Anpassung; tracked = verfolgt; identified = bestimmt; 90 % band = 90-%-Band;
its 90 % band = sein 90-%-Band; ageing as tracked = Alterung, verfolgt; earlier predictions = frühere Vorhersagen;
remaining cycles = restliche Schaltspiele; predicted median = vorhergesagter Median; Inspections = Befundungen; Changes = Änderungen;
Earlier predictions = Frühere Vorhersagen; Roughness = Rauheit; Skewness = Schiefe; Candidates = Kandidaten; Cause = Ursache;
Probability = Wahrscheinlichkeit; Estimate = Schätzung; Run the diagnosis = Diagnose starten; Acknowledge = Quittieren`;

const table = new Map(GERMAN.split(/;\s/).map((pair) => /** @type {[string, string]} */ (pair.trim().split(" = "))));
const german = navigator.language.startsWith("de");

/** @type {(label: string) => string} a label in the reader's language; what the table does not have stays as it is */
export const inWords = (label) => (german && table.get(label.trim())) || label;

if (german) {
  const texts = document.createTreeWalker(document.body ?? document, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) texts.currentNode.nodeValue = inWords(texts.currentNode.nodeValue ?? "");
}
