"""Commands that read one format and write another: convert, export, record, import, formats."""
