
_stickslip_parameters() {
    local words=(@PARAMETERS@)
    compadd "$@" -S '' -- ${(M)words:#*=}
    compadd "$@" -- ${words:#*=}
}
_stickslip_words_or_files() {
    _alternative "words::($1)" "files::_path_files -g '$2'" 'folders::_path_files -/'
}
_stickslip_scenario_files() { _stickslip_words_or_files '@SCENARIOS@' '*.y*ml' }
_stickslip_controller_files() { _stickslip_words_or_files '@LAWS@' '*.py' }
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
