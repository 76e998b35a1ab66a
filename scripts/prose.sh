#!/usr/bin/env bash
# prose.sh: the words of the sources (STYLE.md, "Words"). The limits hold for the whole tree; a file's counts may only fall.
#
#   scripts/prose.sh           holds the limits, and compares each file with scripts/prose.txt
#   scripts/prose.sh --write   writes scripts/prose.txt anew
#   scripts/prose.sh --rooms   prints the counts by room
#   scripts/prose.sh --list    prints every line that counts against a limit
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export LC_ALL=C

readonly MAX_OPENINGS_PERCENT=3 MAX_WORDS=20 MAX_TEST_NAMES=0
readonly BASELINE=scripts/prose.txt

# A doc comment says what its caller gets: it does not open with one of these.
readonly OPENINGS='what|whether|who|whom|whose|whoever|how|so|of|none|nobody'
# Frames are sent and received, nodes report, values are invalid or absent.
readonly WORDS='told|tells?|heard|hears?|heed(s|ed)?|nobody|somebody|whoever|befalls?|befallen|befell|deeds?|mishaps?|temperaments?|(that )?is (?-i:none)|no number'

# The tree as it would be committed. Old decisions keep their words, and so do the tables of CHANGELOG that name what
# was renamed; this file names the words.
readonly HISTORY='^(CHANGELOG\.md|docs/adr/00(0[1-9]|1[0-8])-.*|scripts/prose\.(sh|txt))$'
mapfile -t files < <(git ls-files --cached --others --exclude-standard -- \
  '*.rs' '*.sh' '*.py' '*.toml' '*.md' '*.yml' '*.service' | grep -vE "$HISTORY" | sort -u)
readonly files

# Prints FILE:LINE: KIND TEXT of every finding. KIND is `doc` where a doc comment begins, `opening` where it begins with
# one of OPENINGS, `word` for each of WORDS, `test` for a test whose name has more than 60 characters.
findings() {
  awk -v openings="^(${OPENINGS})([^a-z]|$)" '
    function found(kind) { print FILENAME ":" FNR ": " kind " " $0 }
    FNR == 1 { is_inside = is_test = 0 }
    match($0, /^[ \t]*\/\/[\/!]/) {
      text = tolower(substr($0, RLENGTH + 1))
      sub(/^[ \t]+/, "", text)
      if (text != "" && !is_inside) found("doc")
      if (text != "" && !is_inside && text ~ openings) found("opening")
      is_inside = text != ""
      next
    }
    { is_inside = 0 }
    /#\[(tokio::)?test[](]/ { is_test = 1 }
    is_test && match($0, /fn [a-z0-9_]+/) { is_test = 0; if (RLENGTH - 3 > 60) found("test") }
  ' $(printf '%s\n' "${files[@]}" | grep '\.rs$')
  local words=(grep -onHiP "(?<![a-z])(?:$WORDS)(?![a-z])")
  { "${words[@]}" "${files[@]}"; sed 's/^|.*//' CHANGELOG.md | "${words[@]}" --label=CHANGELOG.md; } |
    sed -E 's/^([^:]+:[0-9]+):/\1: word /' || true
}

# Reads findings, and prints GROUP DOCS OPENINGS WORDS TESTS; a group is a file, or a room with `--rooms`.
counts() {
  awk -v by="$1" '
    { split($1, place, ":"); group = place[1] }
    by == "--rooms" { n = split(group, part, "/"); depth = part[2] == "bench" ? 3 : 2
      if (part[1] != "src" || n <= depth) depth = 1
      group = n > 1 ? part[1] : "(root)"; for (i = 2; i <= depth; i++) group = group "/" part[i] }
    { all[group]; seen[group, $2]++ }
    END { for (group in all) print group, seen[group, "doc"] + 0, seen[group, "opening"] + 0, seen[group, "word"] + 0, seen[group, "test"] + 0 }
  ' | sort
}

case ${1-} in
  --list) findings | grep -vE '^[^ ]+ doc ' ;;
  --rooms) { echo "room docs openings words tests"; findings | counts --rooms; } | column -t ;;
  --write) findings | counts --files | awk '$3 + $4 + $5 { print $1, $3, $4, $5 }' > "$BASELINE" ;;
  '')
    findings | counts --files | awk -v percent="$MAX_OPENINGS_PERCENT" -v words="$MAX_WORDS" -v tests="$MAX_TEST_NAMES" '
      NR == FNR { may["opening", $1] = $2; may["word", $1] = $3; may["test", $1] = $4; next }
      function hold(kind, count) {
        if (count > may[kind, $1] + 0) { print "prose: " $1 ": " count " of " kind ", at most " may[kind, $1] + 0; bad = 1 }
      }
      { docs += $2; openings += $3; all_words += $4; all_tests += $5
        hold("opening", $3); hold("word", $4); hold("test", $5) }
      END {
        if (100 * openings > percent * docs) { print "prose: " openings " of " docs " doc comments open with what, whether, who, how, so, of; at most " percent " %"; bad = 1 }
        if (all_words > words) { print "prose: " all_words " words that STYLE.md replaces; at most " words; bad = 1 }
        if (all_tests > tests) { print "prose: " all_tests " names of tests longer than 60 characters"; bad = 1 }
        if (bad) print "prose: scripts/prose.sh --list prints the lines"
        exit bad
      }' "$BASELINE" - >&2
    ;;
  *) echo "prose: unknown option $1" >&2; exit 2 ;;
esac
