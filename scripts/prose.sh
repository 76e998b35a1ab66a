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
# Doc comments with one of MARKERS, in the whole tree and in a room; rooms of a few comments have none or one.
readonly MAX_MARKED_PERCENT=2 MAX_MARKED_PERCENT_OF_A_ROOM=4
# Types that are participles, and constructors `of`: these may only fall.
readonly MAX_PARTICIPLES=5 MAX_OF=1
readonly BASELINE=scripts/prose.txt

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

# The tree as it would be committed. Old decisions keep their words, and so do the tables of CHANGELOG that name what
# was renamed; this file names the words.
readonly HISTORY='^(CHANGELOG\.md|docs/adr/00(0[1-9]|1[0-8])-.*|scripts/prose\.(sh|txt))$'
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
  { "${words[@]}" "${files[@]}"; sed 's/^|.*//' CHANGELOG.md | "${words[@]}" --label=CHANGELOG.md; } |
    sed -E 's/^([^:]+:[0-9]+):/\1: word /' || true
}

# Reads findings, and prints GROUP and its number of each kind of KINDS; a group is a file, or a room with `--rooms`.
readonly KINDS='doc opening word test comment marked participle of'
counts() {
  awk -v by="$1" -v kinds="$KINDS" '
    { split($1, place, ":"); group = place[1] }
    by == "--rooms" { n = split(group, part, "/"); depth = part[2] == "bench" ? 3 : 2
      if (part[1] != "src" || n <= depth) depth = 1
      group = n > 1 ? part[1] : "(root)"; for (i = 2; i <= depth; i++) group = group "/" part[i] }
    { all[group]; seen[group, $2]++ }
    END { count = split(kinds, kind)
      for (group in all) { printf "%s", group; for (i = 1; i <= count; i++) printf " %d", seen[group, kind[i]]; print "" } }
  ' | sort
}

# Holds the limits of files, against the baseline; the first input.
hold_files() {
  awk -v percent="$MAX_OPENINGS_PERCENT" -v words="$MAX_WORDS" -v tests="$MAX_TEST_NAMES" '
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
      exit bad
    }' "$BASELINE" - >&2
}

# Holds the limits of rooms and of the whole tree.
hold_rooms() {
  awk -v percent="$MAX_MARKED_PERCENT" -v of_room="$MAX_MARKED_PERCENT_OF_A_ROOM" -v participles="$MAX_PARTICIPLES" -v ofs="$MAX_OF" '
    { comments += $6; marked += $7; all_participles += $8; all_ofs += $9 }
    $7 > 1 && 100 * $7 > of_room * $6 { print "prose: " $1 ": " $7 " of " $6 " doc comments have a turn that STYLE.md replaces; at most " of_room " %"; bad = 1 }
    END {
      if (100 * marked > percent * comments) { print "prose: " marked " of " comments " doc comments have a turn that STYLE.md replaces; at most " percent " %"; bad = 1 }
      if (all_participles > participles) { print "prose: " all_participles " types are participles; at most " participles; bad = 1 }
      if (all_ofs > ofs) { print "prose: " all_ofs " functions of the name of; at most " ofs; bad = 1 }
      exit bad
    }' >&2
}

case ${1-} in
  --list) findings | grep -vE '^[^ ]+ (doc|comment) ' ;;
  --rooms) { echo "room $KINDS"; findings | counts --rooms; } | column -t ;;
  --write) findings | counts --files | awk '$3 + $4 + $5 { print $1, $3, $4, $5 }' > "$BASELINE" ;;
  '')
    found=$(findings) bad=''
    counts --files <<<"$found" | hold_files || bad=1
    counts --rooms <<<"$found" | hold_rooms || bad=1
    [[ -z $bad ]] || { echo "prose: scripts/prose.sh --list prints the lines" >&2; exit 1; }
    ;;
  *) echo "prose: unknown option $1" >&2; exit 2 ;;
esac
