// Checks an AsyncAPI document: prints what is wrong and exits with 1 where anything is. Examples are held against their
// schemas, and against a server, by clients/python/tests/test_asyncapi.py.
import { readFileSync } from "node:fs";
import { Parser } from "@asyncapi/parser";

const severities = ["error", "warning", "info", "hint"];
// Version 3.0 is meant.
const accepted = new Set(["asyncapi-latest-version"]);

const [file] = process.argv.slice(2);
const { document, diagnostics } = await new Parser().parse(readFileSync(file, "utf8"), { source: file });
const found = diagnostics.filter(({ code }) => !accepted.has(code));
for (const { severity, code, message, path, range } of found) {
  console.log(`${file}:${range.start.line + 1}: ${severities[severity]} ${code} at ${path.join(".")}: ${message}`);
}
if (document === undefined || found.length > 0) process.exit(1);
console.log(`${file}: valid`);
