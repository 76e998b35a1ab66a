#!/usr/bin/env bash
# prose.sh: a report of the words of the sources (STYLE.md, "Words"), for the reviewer of a change. No gate: it exits with 0
# whatever it counts, and no other script calls it.
#
#   scripts/prose.sh           prints the counts of the whole tree, beside what STYLE.md aims at
#   scripts/prose.sh --rooms   prints the counts by room
#   scripts/prose.sh --list    prints every line that counts
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export LC_ALL=C

# A doc comment says what its caller gets: it does not open with one of these.
readonly OPENINGS='what|whether|who|whom|whose|whoever|how|so|of|none|nobody'
# Frames are sent and received, nodes report, values are invalid or absent.
readonly WORDS='told|tells?|heard|hears?|heed(s|ed)?|nobody|somebody|whoever|befalls?|befallen|befell|deeds?|mishaps?|temperaments?|(that )?is (?-i:none)|no number'

# Turns that no neighbour writes, anywhere in a doc comment, and others in its first sentence.
readonly MARKERS='of which|what is|the same of|stands?|begun|nor|by itself|nothing but'
readonly FIRST_MARKERS='felt|way|whole|asked'

# Types are nouns: what ends so is a participle, but for the nouns after it.
readonly PARTICIPLES='(ed|Held|Felt|Made|Given|Led|Swept|Told|Taken|Known|Shown|Sent|Kept|Seen|Built|Bound|Found|Met|Lost|Drawn|Written|Borne)$'
readonly NOUNS='(Speed|Seed|Feed|Need)$'

# The tree as it would be committed. Old decisions keep their words; this file names the words.
readonly HISTORY='^(docs/adr/00(0[1-9]|1[0-8])-.*|scripts/prose\.(sh|txt))$'
mapfile -t files < <(git ls-files --cached --others --exclude-standard -- \
  '*.rs' '*.sh' '*.py' '*.toml' '*.md' '*.yml' '*.service' | grep -vE "$HISTORY" | sort -u)
readonly files

# Prints FILE:LINE: KIND TEXT of every finding. KIND is `doc` where a paragraph of a doc comment begins, `opening` where it
# begins with one of OPENINGS, `comment` where a doc comment begins, `marked` where it has one of MARKERS, `participle` for
# a type of that name, `of` for a constructor of that name, `word` for each of WORDS, `test` for a test whose name has more
# than 60 characters.
findings() {
  awk -v openings="^(${OPENINGS})([^a-z]|$)" -v markers="[^a-z](${MARKERS})[^a-z]" \
    -v first_markers="[^a-z](${FIRST_MARKERS})[^a-z]" -v participles="$PARTICIPLES" -v nouns="$NOUNS" '
    function found(kind) { print FILENAME ":" FNR ": " kind " " $0 }
    # Judges the comment that has ended: all of it, and its first sentence.
    function judge() {
      if (comment == "") return
      match(comment ". ", /[.!?] /)
      if (comment " " ~ markers || substr(comment, 1, RSTART) " " ~ first_markers) print place ": marked " comment
      comment = ""
    }
    FNR == 1 { judge(); is_inside = is_test = 0 }
    match($0, /^[ \t]*\/\/[\/!]/) {
      text = tolower(substr($0, RLENGTH + 1))
      sub(/^[ \t]+/, "", text)
      if (comment == "") { found("comment"); place = FILENAME ":" FNR }
      # A paragraph ends a sentence.
      comment = comment " " (text == "" ? "." : text)
      if (text != "" && !is_inside) found("doc")
      if (text != "" && !is_inside && text ~ openings) found("opening")
      is_inside = text != ""
      next
    }
    { judge(); is_inside = 0 }
    match($0, /^[ \t]*(pub(\([^)]*\))? )?(struct|enum|trait|type|union) [A-Za-z0-9_]+/) {
      name = substr($0, RSTART, RLENGTH); sub(/.* /, "", name)
      if (name ~ participles && name !~ nouns) found("participle")
    }
    /^[ \t]*(pub(\([^)]*\))? )?(const )?fn of[<(]/ { found("of") }
    /#\[(tokio::)?test[](]/ { is_test = 1 }
    is_test && match($0, /fn [a-z0-9_]+/) { is_test = 0; if (RLENGTH - 3 > 60) found("test") }
    END { judge() }
  ' $(printf '%s\n' "${files[@]}" | grep '\.rs$')
  local words=(grep -onHiP "(?<![a-z])(?:$WORDS)(?![a-z])")
  "${words[@]}" "${files[@]}" |
    sed -E 's/^([^:]+:[0-9]+):/\1: word /' || true
}

# Reads findings, and prints each room with its number of each kind of KINDS.
readonly KINDS='doc opening word test comment marked participle of'
counts() {
  awk -v kinds="$KINDS" '
    { split($1, place, ":"); n = split(place[1], part, "/"); depth = part[2] == "bench" ? 3 : 2
      if (part[1] != "src" || n <= depth) depth = 1
      group = n > 1 ? part[1] : "(root)"; for (i = 2; i <= depth; i++) group = group "/" part[i] }
    { all[group]; seen[group, $2]++ }
    END { count = split(kinds, kind)
      for (group in all) { printf "%s", group; for (i = 1; i <= count; i++) printf " %d", seen[group, kind[i]]; print "" } }
  ' | sort
}

# Reads counts by room, and prints those of the whole tree.
summary() {
  awk '
    { docs += $2; openings += $3; words += $4; tests += $5; comments += $6; marked += $7; participles += $8; ofs += $9 }
    END {
      printf "%5d of %d paragraphs of doc comments open with what, whether, who, how, so, of (aim: 3 %%)\n", openings, docs
      printf "%5d of %d doc comments have a turn that STYLE.md replaces (aim: 2 %%)\n", marked, comments
      printf "%5d words that STYLE.md replaces (aim: 20)\n", words
      printf "%5d types are participles (aim: 5), and %d functions of the name of (aim: 1)\n", participles, ofs
      printf "%5d names of tests are longer than 60 characters (aim: none)\n", tests
    }'
}

case ${1-} in
  --list) findings | grep -vE '^[^ ]+ (doc|comment) ' || true ;;
  --rooms) { echo "room $KINDS"; findings | counts; } | column -t ;;
  '') findings | counts | summary ;;
  *) echo "prose: unknown option $1" >&2; exit 2 ;;
esac
