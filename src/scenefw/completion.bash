# Completion of `scenefw ...` and `python -m scenefw ...` in bash; in zsh after
# `autoload -U bashcompinit && bashcompinit`.

_scenefw_answers() {
    local line=${COMP_LINE:0:$COMP_POINT} word cut="" answer
    word=${line##* }
    # Where "=" ends a word for the shell, it replaces only what comes after.
    if [[ $COMP_WORDBREAKS == *=* && $word == *=* ]]; then cut=${word%"${word##*=}"}; fi
    COMPREPLY=()
    while IFS= read -r answer; do
        COMPREPLY+=("${answer#"$cut"}")
    done < <(COMP_LINE=$line COMP_POINT=${#line} "$@" -sc query=bash 2>/dev/null)
}

_scenefw_command() { _scenefw_answers "$1"; }

_scenefw_module() {
    COMPREPLY=()
    if [[ "$COMP_LINE " == *" -m scenefw "* ]]; then
        type compopt >/dev/null 2>&1 && compopt -o nospace
        _scenefw_answers "$1" -m scenefw
    fi
}

complete -o nospace -o default -F _scenefw_command scenefw
complete -o default -F _scenefw_module python python3
