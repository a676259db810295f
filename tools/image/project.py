"""Writes the MPLAB X project firmware.X from what the Makefile says of files, flags and folders (make project), so that it cannot drift.

    make project-facts | python3 -m tools.image.project [--out firmware.X]

Three files, those that MPLAB X keeps under version control; it makes the rest when it opens the project."""

import sys
import xml.sax.saxutils
from collections.abc import Iterable
from pathlib import Path

from tools.common import command_line
from tools.common.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
FILES = ("Makefile", "nbproject/configurations.xml", "nbproject/project.xml")
TOOL = "pk4hybrid"          # PICkit 4 [?]; the user chooses another one in the project's properties

MAKEFILE = """# The MPLAB X project's own Makefile, written by `make project` of the folder above; MPLAB X makes the two files that it includes.

build: .build-post
.build-pre:
.build-post: .build-impl

clean: .clean-post
.clean-pre:
.clean-post: .clean-impl

clobber: .clobber-post
.clobber-pre:
.clobber-post: .clobber-impl

all: .all-post
.all-pre:
.all-post: .all-impl

help: .help-post
.help-pre:
.help-post: .help-impl

include nbproject/Makefile-impl.mk
include nbproject/Makefile-variables.mk
"""

PROJECT = """<?xml version="1.0" encoding="UTF-8"?>
<project xmlns="http://www.netbeans.org/ns/project/1">
    <type>com.microchip.mplab.nbide.embedded.makeproject</type>
    <configuration>
        <data xmlns="http://www.netbeans.org/ns/make-project/1">
            <name>foc33</name>
            <creation-uuid>0f0c3300-33f1-432c-8204-666f63333300</creation-uuid>
            <make-project-type>0</make-project-type>
            <c-extensions>c</c-extensions>
            <cpp-extensions/>
            <header-extensions>h</header-extensions>
            <asminc-extensions/>
            <sourceEncoding>UTF-8</sourceEncoding>
            <make-dep-projects/>
            <sourceRootList>
{roots}
            </sourceRootList>
            <confList>
                <confElem>
                    <name>default</name>
                    <type>2</type>
                </confElem>
            </confList>
            <formatting>
                <project-formatting-style>false</project-formatting-style>
            </formatting>
        </data>
    </configuration>
</project>
"""

CONFIGURATIONS = """<?xml version="1.0" encoding="UTF-8"?>
<configurationDescriptor version="65">
  <logicalFolder name="root" displayName="root" projectFiles="true">
{headers}
    <logicalFolder name="LinkerScript" displayName="Linker Files" projectFiles="true">
    </logicalFolder>
{sources}
    <logicalFolder name="ExternalFiles" displayName="Important Files" projectFiles="false">
      <itemPath>Makefile</itemPath>
    </logicalFolder>
  </logicalFolder>
  <sourceRootList>
{roots}
  </sourceRootList>
  <projectmakefile>Makefile</projectmakefile>
  <confs>
    <conf name="default" type="2">
      <toolsSet>
        <developmentServer>localhost</developmentServer>
        <targetDevice>dsPIC{device}</targetDevice>
        <targetHeader></targetHeader>
        <targetPluginBoard></targetPluginBoard>
        <platformTool>{tool}</platformTool>
        <languageToolchain>XC16</languageToolchain>
        <languageToolchainVersion>2.10</languageToolchainVersion>
        <platform>2</platform>
      </toolsSet>
      <compileType>
        <linkerTool>
          <linkerLibItems>
          </linkerLibItems>
        </linkerTool>
        <archiverTool>
        </archiverTool>
        <loading>
          <useAlternateLoadableFile>false</useAlternateLoadableFile>
          <parseOnProdLoad>false</parseOnProdLoad>
          <alternateLoadableFile></alternateLoadableFile>
        </loading>
        <subordinates>
        </subordinates>
      </compileType>
      <makeCustomizationType>
        <makeCustomizationPreStepEnabled>false</makeCustomizationPreStepEnabled>
        <makeCustomizationPreStep></makeCustomizationPreStep>
        <makeCustomizationPostStepEnabled>false</makeCustomizationPostStepEnabled>
        <makeCustomizationPostStep></makeCustomizationPostStep>
        <makeCustomizationPutChecksumInUserID>false</makeCustomizationPutChecksumInUserID>
        <makeCustomizationEnableLongLines>false</makeCustomizationEnableLongLines>
        <makeCustomizationNormalizeHexFile>false</makeCustomizationNormalizeHexFile>
      </makeCustomizationType>
      <C30>
{compiler}
      </C30>
      <C30-AR>
      </C30-AR>
      <C30-AS>
      </C30-AS>
      <C30-LD>
{linker}
      </C30-LD>
      <C30Global>
{common}
      </C30Global>
    </conf>
  </confs>
</configurationDescriptor>
"""

#: flags that MPLAB X has a box for: it passes them itself
BOXES = {
    "-g": ("enable-symbols", "true"), "-Wall": ("enable-all-warnings", "true"), "-ffunction-sections": ("isolate-each-function", "true"),
    "-O0": ("optimization-level", "0"), "-O1": ("optimization-level", "1"), "-O2": ("optimization-level", "2"),
    "-O3": ("optimization-level", "3"),
}
LINKER_BOXES = {"--gc-sections": ("remove-unused-sections", "true"), "--report-mem": ("report-memory-usage", "true")}


def read(lines: Iterable[str]) -> dict[str, list[str]]:
    """Facts by kind: file, flag, include, link, device."""
    facts: dict[str, list[str]] = {"file": [], "flag": [], "include": [], "link": [], "device": []}
    for line in lines:
        kind, _, value = line.strip().partition(" ")
        if kind not in facts or not value:
            raise UserError(f"not a fact of the project: '{line.strip()[:60]}'", "make project", "this is what make project-facts prints")
        facts[kind].append(value)
    if len(facts["device"]) != 1 or not facts["file"]:
        raise UserError("no device or no files", "make project", "this is what make project-facts prints")
    return facts


def above(path: str) -> str:
    """The same path, seen from the project's folder."""
    return ".." if path in (".", "./") else f"../{path}"


def folder(name: str, title: str, files: list[str]) -> str:
    """MPLAB X's folder of files, with one folder inside for each folder of the sources."""
    groups: dict[str, list[str]] = {}
    for file in sorted(files):
        groups.setdefault(Path(file).parent.name, []).append(file)
    lines = [f'    <logicalFolder name="{name}" displayName="{title}" projectFiles="true">']
    for number, (group, inside) in enumerate(sorted(groups.items(), key=lambda item: (not item[0], item[0])), 1):
        indent = "      "
        if group:
            lines.append(f'      <logicalFolder name="f{number}" displayName="{xml.sax.saxutils.escape(group)}" projectFiles="true">')
            indent += "  "
        lines += [f"{indent}<itemPath>{xml.sax.saxutils.escape(above(file))}</itemPath>" for file in inside]
        if group:
            lines.append("      </logicalFolder>")
    return "\n".join([*lines, "    </logicalFolder>"])


def options(known: dict[str, tuple[str, str]], flags: list[str], more: dict[str, str]) -> str:
    """A tool's boxes, and as additional options what has no box."""
    boxes = {**more, **dict(known[flag] for flag in flags if flag in known)}
    rest = " ".join(flag for flag in flags if flag not in known)
    quoted = xml.sax.saxutils.quoteattr
    lines = [f"        <property key={quoted(key)} value={quoted(value)}/>" for key, value in sorted(boxes.items())]
    if rest:
        lines.append(f"        <appendMe value={quoted(rest)}/>")
    return "\n".join(lines)


def project(facts: dict[str, list[str]]) -> dict[str, str]:
    """Text of each of the three files."""
    sources = [file for file in facts["file"] if file.endswith(".c")]
    headers = [file for file in facts["file"] if file.endswith(".h")]
    roots = sorted({above(file.split("/")[0] if "/" in file else ".") for file in facts["file"]})
    include = ";".join(above(path) for path in facts["include"])
    configurations = CONFIGURATIONS.format(
        headers=folder("HeaderFiles", "Header Files", headers), sources=folder("SourceFiles", "Source Files", sources),
        roots="\n".join(f"    <Elem>{root}</Elem>" for root in roots), device=facts["device"][0], tool=TOOL,
        compiler=options(BOXES, facts["flag"], {"extra-include-directories": include, "preprocessor-macros": "",
                                                "enable-fatal-warnings": "false"}),
        linker=options(LINKER_BOXES, facts["link"], {"map-file": "${DISTDIR}/${PROJECTNAME}.${IMAGE_TYPE}.map", "stack-size": "16",
                                                     "heap-size": "", "enable-default-isr": "true", "enable-data-init": "true"}),
        common=options({}, [], {"output-file-format": "elf", "common-include-directories": "", "legacy-libc": "false"}))
    sources_roots = "\n".join(f"                <sourceRootElem>{root}</sourceRootElem>" for root in roots)
    return dict(zip(FILES, (MAKEFILE, configurations, PROJECT.format(roots=sources_roots))))


def main(arguments: list[str] | None = None) -> int:
    parser = command_line.Parser(prog="python3 -m tools.image.project", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "firmware.X", help="the project's folder (firmware.X)")
    return command_line.run(lambda: _write(parser.parse_args(arguments).out))


def _write(out: Path) -> int:
    try:
        texts = project(read(sys.stdin))
        for name, text in texts.items():
            (out / name).parent.mkdir(parents=True, exist_ok=True)
            (out / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"cannot write the project ({error.strerror})", str(out), "check the folder's permissions") from None
    print(f"{out.name}: {', '.join(texts)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
