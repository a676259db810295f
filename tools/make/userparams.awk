# Names in userparams.h that cannot be meant: defined twice with two values, or close to a name that is missing.
#
#   awk -v places=FILE -v least=FILE -v refused=FILE -v near=FILE -f tools/make/nearest.awk -f tools/make/userparams.awk KNOWN DEFINED
#
# KNOWN: the rows of the tables of parameters and modes, with @ between the cells; DEFINED: userparams.h as gcc -E -dD shows it, with line
# markers. To the files go: where each parameter stands (name, file:line, range, with tabs between them); the least value of each (name, value);
# the names that are refused; the missing names that they may stand for.

function refuse(name, what) {
    print "foc33: " what
    print name >>refused
}

BEGIN { option = "DEFINES or the scenario" }
FNR == NR {
    rows = rows $0
    next
}
/^# [0-9]+ "/ {
    line = $2 - 1
    file = $0
    sub(/^# [0-9]+ "/, "", file)
    by_option = file ~ /^<command/
    counts = by_option || (file !~ /^</ && file !~ /" .*3/) # 3: a header of the compiler
    sub(/".*/, "", file)
    sub(/^\.\//, "", file)
    next
}
{ line++ }
$1 == "#undef" { delete value[$2] }
$1 == "#define" && counts {
    name = $2
    sub(/\(.*/, "", name)
    text = substr($0, length("#define " name) + 2)
    here = by_option ? option : file ":" line
    if (name in value && value[name] != text)
        refuse(name, here ": " name (text == "" ? "" : " = " text) " is the second definition, the first stands in " place[name] \
               ": keep one of the two")
    value[name] = text
    place[name] = here
    used = used " " text
}

END {
    count = split(rows, cell, "@")
    for (i = 2; i + 2 <= count; i += 4) {
        gsub(/[" ]/, "", cell[i + 1])
        gsub(/"/, "", cell[i + 2])
        known[cell[i + 1]] = cell[i + 2]
        if (cell[i] ~ /parameter/) {
            split(cell[i + 2], ends, " ")
            print cell[i + 1] "\t" ends[1] >least
        }
    }
    gsub(/[^A-Za-z0-9_]+/, " ", used)
    used = " " used " "
    for (word in known)
        if (!(word in value)) missing = missing " " word
    for (name in value) {
        if (name in known)
            print name "\t" place[name] "\t" known[name] >places
        else if (place[name] != option && !index(used, " " name " ")) { # what another macro uses is the user's own
            meant = nearest(name, missing, 0.83)
            if (meant == "") continue
            refuse(meant, place[name] ": " name " is no parameter: did you mean " meant (known[meant] == "" ? "" : ", " known[meant]) "?")
            print meant >>near
        }
    }
}
