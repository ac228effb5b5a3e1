"""Results of a run for people and programs: text, JSON, SARIF, documents, plots. No verdict is made here."""
